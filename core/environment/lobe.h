#pragma once

// The kernels that prefiltering convolves with: functions of the angle to the mirror direction
// alone, since normal, view and mirror direction are taken as one (n = v = r).

#include <memory>
#include <vector>

namespace lightkiln {

enum class LobeKind { ggx, charlie };

// alpha is roughness squared, in (0, 1].
struct Lobe {
  LobeKind kind = LobeKind::ggx;
  double alpha = 1;
};

// An average over the sphere: it integrates to 1 and vanishes below the horizon.
class ZonalKernel {
 public:
  virtual ~ZonalKernel() = default;
  virtual double at_angle(double angle_rad) const = 0;
  // How wide a Gauss panel that begins at this angle may be.
  virtual double panel(double angle_rad) const = 0;
  // By how much it grows per unit of cosine just above the horizon, where it has a kink.
  virtual double horizon_slope() const = 0;
};
std::unique_ptr<ZonalKernel> make_kernel(const Lobe& lobe);

// h_l: what the convolution multiplies band l by, for l < bands. Quadrature accurate to 1e-10 for
// any band.
std::vector<double> band_responses(const ZonalKernel& kernel, int bands);

}  // namespace lightkiln

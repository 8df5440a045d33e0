#pragma once

// The GGX reflection lobe with normal, view and mirror direction in one (n = v = r), which makes
// prefiltering a convolution with a kernel of the angle to r alone.

#include <vector>

namespace lightkiln {

// Average over the sphere of light weighted by lobe(cosine): the lobe integrates to 1. alpha is
// roughness squared, in (0, 1]; at alpha = 1 it is the clamped cosine over pi.
class GgxLobe {
 public:
  explicit GgxLobe(double alpha);

  double alpha() const { return alpha_; }
  double operator()(double cosine) const;
  // The same from the angle, exact for narrow lobes, where the cosine has lost its digits.
  double at_angle(double angle_rad) const;

 private:
  double alpha_, narrow_, broad_, scale_;
};

// h_l: what the convolution multiplies band l by, for l < bands; h_0 = 1. Quadrature accurate to
// 1e-10 for any band.
std::vector<double> ggx_band_responses(const GgxLobe& lobe, int bands);

}  // namespace lightkiln

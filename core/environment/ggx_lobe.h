#pragma once

// The GGX reflection lobe with normal, view and mirror direction in one (n = v = r), which makes
// prefiltering a convolution with a kernel of the angle to r alone.

#include <vector>

#include "core/environment/lobe.h"

namespace lightkiln {

// Average over the sphere of light weighted by lobe(cosine): the lobe integrates to 1. alpha is
// roughness squared, in (0, 1]; at alpha = 1 it is the clamped cosine over pi.
class GgxLobe final : public ZonalKernel {
 public:
  explicit GgxLobe(double alpha);

  double alpha() const { return alpha_; }
  double operator()(double cosine) const {
    const double beside = 1 - cosine > 0 ? 1 - cosine : 0;
    const double d = narrow_ + broad_ * beside;
    const double value = scale_ * cosine / (d * d);
    return cosine > 0 ? value : 0;
  }
  // The same from the angle, exact for narrow lobes, where the cosine has lost its digits.
  double at_angle(double angle_rad) const override;
  double panel(double angle_rad) const override;
  double horizon_slope() const override;

  // The lobe at 1 - cosine = x is scale() (1 - x) / d^2 with d = narrow() + broad() x.
  double scale() const { return scale_; }
  double narrow() const { return narrow_; }
  double broad() const { return broad_; }

 private:
  double alpha_, narrow_, broad_, scale_;
};

// What is left of a GGX lobe when its core is taken out: a kernel without structure finer than
// about 2 / sqrt(split), whatever alpha. The core is lobe (1 + split d) exp(-split d), with d as
// above, and dies out like a Gaussian.
class GgxHalo final : public ZonalKernel {
 public:
  GgxHalo(double alpha, double split) : lobe_(alpha), split_(split) {}

  double at_angle(double angle_rad) const override;
  double panel(double angle_rad) const override;
  double horizon_slope() const override;

 private:
  double share(double distance) const;  // of the lobe, at 1 - cosine

  GgxLobe lobe_;
  double split_;
};

std::vector<double> ggx_band_responses(const GgxLobe& lobe, int bands);

}  // namespace lightkiln

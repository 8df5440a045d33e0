#pragma once

// The "Charlie" sheen lobe of Estevez & Kulla with normal, view and mirror direction in one.

#include "core/environment/lobe.h"

namespace lightkiln {

// The kernel that glTF-IBL-Sampler's Charlie cube maps are drawn from and that viewers of
// KHR_materials_sheen look up by the mirror direction: half vectors by D(h) n.h, light weighted by
// n.l. alpha in (0, 1]. It is a ring that tightens about the horizon as alpha falls.
class CharlieLobe final : public ZonalKernel {
 public:
  explicit CharlieLobe(double alpha);

  double operator()(double cosine) const;
  double at_angle(double angle_rad) const override;
  double panel(double angle_rad) const override;
  double horizon_slope() const override { return scale_; }

  // The lobe at 1 - cosine = x is scale() (1 - x) x^power().
  double power() const { return power_; }
  double scale() const { return scale_; }

 private:
  double power_, scale_;
};

// Below this roughness the ring is thinner than any band limit in use could draw; viewers clamp
// sheen's roughness near it, and a level ordered below it is made with it.
inline constexpr double kMinSheenRoughness = 0.1;

}  // namespace lightkiln

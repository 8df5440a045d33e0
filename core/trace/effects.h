#pragma once

// Which effects of light a scene calls for, why, and how much each could matter. A pure function of
// survey and order. What is off costs nothing and changes nothing.
//
// Bounds are luminances relative to the job's mean luminance, the unit of target_error: no texel of
// a probe changes by more when the effect is left out. With rho the largest albedo, S the brightest
// luminance seen directly and R the largest irradiance over pi that a surface receives directly:
//   light after one reflection <= rho R, after all <= rho R / (1 - rho),
//   what lies behind k reflections <= R rho^(k+1) / (1 - rho).
// For an environment R <= min(max L, 4 mean L), since a hemisphere holds at most the sphere's
// integral 4 pi mean L. Bounds end at kBoundCeiling: with rho = 1 there is none.

#include <optional>
#include <string>
#include <vector>

#include "core/trace/light_survey.h"

namespace lightkiln {

inline constexpr int kMostBounces = 64;
inline constexpr int kMostHalvings = 4;
inline constexpr double kBoundCeiling = 1e6;
// A light whose bound is under this share of the ordered error is left out.
inline constexpr double kNegligibleShare = 0.02;
// Bounces end where what lies behind them is under this share of the ordered error.
inline constexpr double kTruncationShare = 0.1;
// A point or spot light that shines on less than this share of all area is followed to where it
// shines: paths that meet the patch by chance are too few to tell that they missed it.
inline constexpr double kSmallPatch = 1.0 / 64;
// What both leave out together at the most: five kinds of light, and late bounces. An order whose
// bias cannot be kept under it (see EffectPlan::bias_bound) says so in a warning.
inline constexpr double kBiasShare = 5 * kNegligibleShare + kTruncationShare;

struct EffectOrder {
  std::optional<int> max_bounces;  // none = by bound
  double target_error = 0.05;      // relative to reference_luminance
  double reference_luminance = 0;  // the job's mean luminance; 0 = not known yet
};

// What the kernels obey.
struct EffectSelection {
  bool environment = false;
  bool environment_sampling = false;  // importance sampling; off for a constant environment
  bool emissive = false;
  bool emissive_sampling = false;  // off where emitters cover so much that paths meet them anyway
  bool unlit = false;              // unlit surfaces are looked for, as the sun and lamps are
  bool punctual[3] = {false, false, false};  // by LightKind
  bool punctual_patches = false;  // paths also start at lights that shine on little (kSmallPatch)
  bool textures = false;
  bool vertex_colors = false;
  bool alpha_test = false;
  int max_bounces = 0;
  // A path ends once its throughput is at or under this: what lies behind it is under the same
  // bound as what lies behind max_bounces. 0 = never.
  float throughput_floor = 0;
  // Paths go on to vertex number halving[i] (the probe sees vertex 0) for one in 2^(i + 1) samples,
  // at weights that make up for the others: see survives() in radiance.h.
  int halving[kMostHalvings] = {kMostBounces + 1, kMostBounces + 1, kMostBounces + 1,
                                kMostBounces + 1};

  bool operator==(const EffectSelection&) const = default;
};

struct EffectReason {
  std::string name;
  bool active = false;
  std::string reason;
  double bound = 0;
};

struct EffectPlan {
  EffectSelection selection;
  std::vector<EffectReason> reasons;
  std::vector<std::string> warnings;
  double truncation_bound = 0;  // of the bounces chosen
  // What the choices made here take from a result at the most: lights left out as negligible and,
  // unless max_bounces was ordered, bounces past the last. What was ordered is no bias.
  double bias_bound = 0;
};

EffectPlan decide_effects(const LightSurvey& survey, const EffectOrder& order);

// R rho^(k+1) / (1 - rho), relative to the reference luminance, at most kBoundCeiling.
double truncation_bound(const LightSurvey& survey, const EffectOrder& order, int bounces);

// The selection that a plan's list of active effects stands for: `reasons` decide what is on,
// bounces and floors follow from survey and order as in decide_effects.
EffectSelection selection_of(const std::vector<EffectReason>& reasons, int max_bounces,
                             const LightSurvey& survey, const EffectOrder& order);

}  // namespace lightkiln

#include "core/trace/effects.h"

#include <algorithm>

#include "core/base/text.h"

namespace lightkiln {

namespace {

std::string percent(double part, double whole) {
  return short_number(whole > 0 ? 100 * part / whole : 0) + " %";
}

const char* punctual_name(int kind) {
  static const char* const kNames[] = {"punctual_directional", "punctual_point", "punctual_spot"};
  return kNames[kind];
}
const char* punctual_noun(int kind) {
  static const char* const kNouns[] = {"directional", "point", "spot"};
  return kNouns[kind];
}

// Upper bounds relative to the reference luminance; infinity is cut at kBoundCeiling.
class RelativeBounds {
 public:
  RelativeBounds(const LightSurvey& survey, const EffectOrder& order)
      : survey_(survey),
        reference_(order.reference_luminance > 0 ? order.reference_luminance : 1) {}

  double environment_irradiance() const {
    return survey_.environment ? std::min(survey_.environment_max, 4 * survey_.environment_mean)
                               : 0;
  }
  double punctual_irradiance(int kind) const {
    return survey_.punctual[kind].max_irradiance_over_pi;
  }
  // R: all lights together.
  double irradiance() const {
    double sum = environment_irradiance() + survey_.max_emission;
    for (int kind = 0; kind < 3; ++kind) sum += punctual_irradiance(kind);
    return sum;
  }
  double relative(double luminance) const {
    const double value = luminance / reference_;
    return value < kBoundCeiling ? value : kBoundCeiling;  // also for NaN
  }
  // `direct` seen by the probe, and all reflections of light that arrives with `arriving`.
  double whole(double direct, double arriving) const {
    if (!(arriving > 0) || !(survey_.max_albedo > 0)) return relative(direct);
    if (survey_.max_albedo >= 1) return kBoundCeiling;
    return relative(direct + arriving * survey_.max_albedo / (1 - survey_.max_albedo));
  }
  double environment() const {
    return survey_.environment ? whole(survey_.environment_max, environment_irradiance()) : 0;
  }
  double emissive() const { return whole(survey_.max_emission, survey_.max_emission); }
  double punctual(int kind) const { return whole(0, punctual_irradiance(kind)); }
  double reflected() const { return whole(0, irradiance()); }
  double everything() const {
    return whole(std::max(survey_.environment_max, survey_.max_emission), irradiance());
  }

 private:
  const LightSurvey& survey_;
  double reference_;
};

int fewest_bounces(const LightSurvey& survey, const EffectOrder& order) {
  for (int k = 0; k < kMostBounces; ++k) {
    if (truncation_bound(survey, order, k) <= kTruncationShare * order.target_error) return k;
  }
  return kMostBounces;
}

// The rate that costs least for a given noise follows the light that is left, mean_albedo^b; it is
// rounded to powers of two. The first two vertices always see every sample.
void choose_halvings(const LightSurvey& survey, EffectSelection* selection) {
  const double albedo = survey.mean_albedo;
  for (int i = 0; i < kMostHalvings; ++i) {
    if (!(albedo > 0) || albedo >= 1) continue;
    int depth = 0;
    for (double left = 1; depth < kMostBounces && left > std::exp2(-(i + 1)); ++depth) {
      left *= albedo;
    }
    selection->halving[i] = std::max(i + 2, depth);
  }
}

class Decision {
 public:
  Decision(const LightSurvey& survey, const EffectOrder& order)
      : survey_(survey), order_(order), bounds_(survey, order) {}

  EffectPlan take() {
    lights();
    surfaces();
    bounces();
    not_simulated();
    plan_.selection = selection_of(plan_.reasons, plan_.selection.max_bounces, survey_, order_);
    return std::move(plan_);
  }

 private:
  void add(const char* name, bool active, std::string reason, double bound) {
    plan_.reasons.push_back({name, active, std::move(reason), bound});
  }
  bool negligible(double bound) const {
    return order_.reference_luminance > 0 && bound < kNegligibleShare * order_.target_error;
  }
  // A light that is there: on unless its bound is negligible.
  void add_light(const char* name, const std::string& what, double bound) {
    if (negligible(bound)) {
      add(name, false,
          what + ", but changes no result by more than " + short_number(bound) + ", under " +
              short_number(100 * kNegligibleShare) + " % of the ordered error.",
          bound);
      plan_.bias_bound += bound;
    } else {
      add(name, true, what + ".", bound);
    }
  }

  void lights() {
    if (survey_.environment) {
      add_light(
          "environment",
          "The environment shines with mean luminance " + short_number(survey_.environment_mean),
          bounds_.environment());
    } else {
      add("environment", false, "There is no environment, or it is black.", 0);
    }
    const bool lit = plan_.reasons.back().active;
    if (!lit || survey_.environment_constant) {
      add("environment_variation", false,
          lit ? "The environment is constant: no direction is worth more than another."
              : "No environment is simulated.",
          0);
    } else {
      add("environment_variation", true,
          "The brightest texel is " +
              short_number(survey_.environment_max / survey_.environment_mean) +
              " times the mean, so directions are drawn by importance.",
          bounds_.environment());
    }
    emitters();
    for (int kind = 0; kind < 3; ++kind) {
      const uint64_t count = survey_.punctual[kind].count;
      const std::string noun = std::string(punctual_noun(kind)) + " light";
      if (count == 0) {
        add(punctual_name(kind), false, "No " + noun + " shines.", 0);
      } else {
        add_light(punctual_name(kind),
                  (count == 1 ? "One " + noun + " lights surfaces"
                              : std::to_string(count) + " " + noun + "s light surfaces") +
                      ", unseen by the probe itself",
                  bounds_.punctual(kind));
      }
    }
    patches();
  }

  void patches() {
    double least = INFINITY;
    for (const int kind : {static_cast<int>(LightKind::point), static_cast<int>(LightKind::spot)}) {
      const EffectReason& light =
          plan_.reasons[plan_.reasons.size() - 3 + static_cast<size_t>(kind)];
      if (light.active) least = std::min(least, survey_.punctual[kind].least_patch);
    }
    const bool small = least < kSmallPatch;
    add("punctual_patches", small,
        small ? "A point or spot light shines on about " + short_number(100 * least) +
                    " % of the area, so paths start there too; this lowers noise only."
              : "No point or spot light shines on a small patch alone.",
        0);
  }

  void emitters() {
    if (!(survey_.emissive_area > 0)) {
      add("emissive_surfaces", false, "No surface emits light.", 0);
      add("emissive_sampling", false, "No surface emits light.", 0);
      return;
    }
    add_light(
        "emissive_surfaces",
        "Surfaces of " + percent(survey_.emissive_area, survey_.area) + " of the area emit light",
        bounds_.emissive());
    // Emitters count by what they emit next to the brightest: a hot spot is small on a dim wall.
    const double as_bright = survey_.emissive_power / survey_.max_emission;
    const bool sampled = plan_.reasons.back().active && 2 * as_bright < survey_.area;
    add("emissive_sampling", sampled,
        !plan_.reasons.back().active ? "No surface emits light that counts."
        : sampled ? "Emitters are few, so shadow rays look for them; this lowers noise only."
                  : "Emitters cover at least half of the area evenly: paths meet them unaided.",
        0);
  }

  void surfaces() {
    const double reflected = bounds_.reflected(), everything = bounds_.everything();
    add("textures", survey_.textured,
        survey_.textured ? "Some texture of colour or emission is not white."
                         : "No texture changes a colour.",
        survey_.textured ? everything : 0);
    add("vertex_colors", survey_.vertex_colored,
        survey_.vertex_colored ? "Some vertex colour is not white."
                               : "No vertex colour changes a colour.",
        survey_.vertex_colored ? reflected : 0);
    add("alpha_test", survey_.alpha_tested,
        survey_.alpha_tested ? "Some masked surface has alpha under its cutoff."
                             : "No masked surface has alpha under its cutoff.",
        survey_.alpha_tested ? everything : 0);
    const bool unlit = survey_.unlit_area > 0;
    add("unlit", unlit,
        unlit ? "Unlit surfaces of " + percent(survey_.unlit_area, survey_.area) +
                    " of the area show their base colour to the probe, absorb all light and give "
                    "none."
              : "No surface is unlit.",
        unlit ? bounds_.relative(1) : 0);
  }

  void bounces() {
    int k = order_.max_bounces ? *order_.max_bounces : fewest_bounces(survey_, order_);
    const double left = truncation_bound(survey_, order_, k);
    plan_.truncation_bound = left;
    if (!order_.max_bounces) plan_.bias_bound = std::min(plan_.bias_bound + left, kBoundCeiling);
    plan_.selection.max_bounces = k;
    const std::string albedo = "the largest albedo is " + short_number(survey_.max_albedo);
    std::string reason;
    if (k == 0) {
      reason = order_.max_bounces ? "No bounce was ordered; " + albedo + "."
                                  : "No surface reflects enough light to see; " + albedo + ".";
    } else {
      reason = std::to_string(k) + (k == 1 ? " bounce" : " bounces") +
               (order_.max_bounces ? " ordered; " : "; ") + albedo +
               ", so that later ones add at most " + short_number(left) + ".";
    }
    add("diffuse_bounces", k > 0, std::move(reason), k > 0 ? bounds_.reflected() : left);
    if (!order_.max_bounces && left > kTruncationShare * order_.target_error) {
      plan_.warnings.push_back("Bounces end at " + std::to_string(kMostBounces) +
                               ", where the bound on what is lost (" + short_number(left) +
                               ") is above a tenth of the ordered error: the largest albedo is " +
                               short_number(survey_.max_albedo) + ".");
    }
  }

  void not_simulated() {
    const double bound = survey_.area > survey_.unlit_area ? bounds_.reflected() : 0;
    const std::string share = percent(survey_.metallic_area, survey_.area);
    add("specular_reflection", false,
        "Not simulated: every surface reflects diffusely; " + share + " of the area is metallic.",
        bound);
    if (survey_.metallic_area > 0) {
      plan_.warnings.push_back(
          "Specular reflection is treated as diffuse: metallic surfaces make up " + share +
          " of the area.");
    }
    const bool blended = survey_.blend_area > 0;
    add("transmission", false,
        blended ? "Not simulated: surfaces of alpha mode BLEND, " +
                      percent(survey_.blend_area, survey_.area) + " of the area, are opaque."
                : "No surface is blended.",
        blended ? bounds_.everything() : 0);
    if (blended) {
      plan_.warnings.push_back("Surfaces of alpha mode BLEND (" +
                               percent(survey_.blend_area, survey_.area) +
                               " of the area) are treated as opaque.");
    }
    add("nearest_distance", true, "Every probe records how far its surroundings are.", 0);
  }

  const LightSurvey& survey_;
  const EffectOrder& order_;
  RelativeBounds bounds_;
  EffectPlan plan_;
};

}  // namespace

EffectPlan decide_effects(const LightSurvey& survey, const EffectOrder& order) {
  return Decision(survey, order).take();
}

double truncation_bound(const LightSurvey& survey, const EffectOrder& order, int bounces) {
  const RelativeBounds bounds(survey, order);
  const double arriving = bounds.irradiance(), albedo = survey.max_albedo;
  if (!(arriving > 0) || !(albedo > 0)) return 0;
  if (albedo >= 1) return kBoundCeiling;
  return bounds.relative(arriving * std::pow(albedo, bounces + 1) / (1 - albedo));
}

EffectSelection selection_of(const std::vector<EffectReason>& reasons, int max_bounces,
                             const LightSurvey& survey, const EffectOrder& order) {
  const auto on = [&](const char* name) {
    return std::any_of(reasons.begin(), reasons.end(), [&](const EffectReason& effect) {
      return effect.active && effect.name == name;
    });
  };
  EffectSelection selection;
  selection.environment = on("environment");
  selection.environment_sampling = on("environment_variation");
  selection.emissive = on("emissive_surfaces");
  selection.emissive_sampling = on("emissive_sampling");
  for (int kind = 0; kind < 3; ++kind) selection.punctual[kind] = on(punctual_name(kind));
  selection.unlit = on("unlit");
  selection.punctual_patches = on("punctual_patches");
  selection.textures = on("textures");
  selection.vertex_colors = on("vertex_colors");
  selection.alpha_test = on("alpha_test");
  selection.max_bounces = max_bounces;
  choose_halvings(survey, &selection);
  const RelativeBounds bounds(survey, order);
  if (!order.max_bounces && survey.max_albedo < 1 && bounds.irradiance() > 0) {
    const double reference = order.reference_luminance > 0 ? order.reference_luminance : 1;
    selection.throughput_floor =
        static_cast<float>(kTruncationShare * order.target_error * reference *
                           (1 - survey.max_albedo) / bounds.irradiance());
  }
  return selection;
}

}  // namespace lightkiln

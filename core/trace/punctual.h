#pragma once

// KHR_lights_punctual as radiometry: points without size, met by shadow rays alone. A probe does
// not see them, it sees what they light.

#include <vector>

#include "core/base/random.h"
#include "core/scene/scene.h"
#include "core/trace/effects.h"

namespace lightkiln {

// Light that arrives at a point from one light.
struct PunctualSample {
  Vec3 to_light;    // normalised space; the light lies at its end, or (directional) infinitely far
  Vec3 irradiance;  // on a surface facing the light
  bool distant = false;
};

// A ray of light that leaves a light.
struct LightBeam {
  size_t light = 0;
  Vec3 origin;  // normalised space
  Vec3 direction;
};

class PunctualLights {
 public:
  // Up to this many lights each get a shadow ray; of more, one is drawn by its share of intensity.
  static constexpr size_t kEveryLight = 8;

  PunctualLights() = default;
  // The lights of `scene` whose kind is selected and that shine.
  PunctualLights(const Scene& scene, const LightSurvey& survey, const EffectSelection& selection);

  size_t size() const { return lights_.size(); }

  // Candela over the squared distance in metres (point, spot), lux as given (directional); the
  // extension's range window and cone attenuation. False where nothing arrives: out of range,
  // outside the cone, or exactly at the light.
  bool light_at(size_t light, const Vec3& point, PunctualSample* sample) const;

  // A light drawn by intensity, and its probability. choice in [0, 1).
  size_t choose(float choice, float* probability) const;
  // The probability that the path tracer looks at a light from any one point.
  float chance(size_t light) const;

  // Lights that shine on small patches (EffectSelection::punctual_patches) send beams, uniform over
  // sphere or cone.
  bool has_beams() const { return !beams_.empty(); }
  LightBeam beam(const Point4& u) const;
  // Density of beam() per steradian around a light, within its cone; 0 for one that sends none.
  float beam_density(size_t light) const { return lights_[light].beam_density; }

 private:
  struct Light {
    LightKind kind;
    Vec3d position;  // normalised
    Vec3d direction;
    Vec3d intensity;
    double range = 0;  // metres; 0 = unlimited
    double cone_scale = 0, cone_offset = 0;
    double cone_height = 2;  // 1 - cosine of its cone's half angle
    float beam_density = 0;
  };
  void prepare_beams(const std::vector<double>& weights);

  std::vector<Light> lights_;
  std::vector<double> cdf_;
  std::vector<size_t> beams_;  // lights that send some
  std::vector<double> beam_cdf_;
  double metres_per_unit_ = 1;
};

}  // namespace lightkiln

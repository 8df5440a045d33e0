// The sun that was taken out of the map when it was opened, before any other output was made.

#include "core/bake/maps_cost.h"
#include "core/bake/maps_output.h"
#include "core/base/text.h"
#include "core/scene/gltf_lights.h"

namespace lightkiln {

namespace {

// Of energy before and after: sums in double over the same texels.
constexpr double kSunErrorBound = 1e-9;

class Sun : public MapsOutput {
 public:
  Sun(const SunExtraction& sun, int bands, double map_texels)
      : sun_(sun), bands_(bands), map_texels_(map_texels) {}

  double error_bound() const override { return sun_.found ? kSunErrorBound : 0; }
  double model_seconds(MapsLight&) const override { return kSunPerTexel * map_texels_; }

  // No values: every process takes the same sun out when it opens the map. What is checked is that
  // disk and rest hold what the map held.
  MeasuredError make(MapsLight& light, int check_texels, ByteWriter&,
                     Progress& progress) const override {
    progress.check();
    ErrorMeter meter(length(sun_.energy_before));
    if (check_texels > 0 && sun_.found) {
      const Vec3d rest = light.environment().mean * (4 * kPi);
      meter.add(rest + sun_.disk.energy(), sun_.energy_before);
    }
    return meter.result();
  }

  void file(ByteReader&, const MeasuredError& measured, MapsResult* result) const override {
    result->document.sun = sun_;
    result->document.sun_measured = measured;
    if (!sun_.found) return;
    result->document.sun_sh = sun_harmonics(sun_.disk, bands_);
    result->document.sun_artifact = "sun.gltf";
    const GltfDirectionalLight light{"sun", sun_.disk.direction, sun_.disk.irradiance()};
    result->assembly.artifacts.push_back(
        {result->document.sun_artifact, "lights", "model/gltf+json",
         write_gltf_lights({&light, 1}, std::string("Lightkiln ") + kEngineVersion)});
  }

 private:
  SunExtraction sun_;
  int bands_;
  double map_texels_;
};

// As many bands of the disk as of the rest, so that they can be added.
void order_sun(const EnvironmentMapsParameters& parameters, MapsLight& light, double,
               MapsOutputs* outputs) {
  const int bands = parameters.sh ? parameters.sh->bands : ShOutput{}.bands;
  const Image& map = light.environment().radiance;
  outputs->push_back(std::make_unique<Sun>(light.sun().value(), bands,
                                           static_cast<double>(map.width) * map.height));
}

Effect sun_effect(const MapsLight& light) {
  const SunExtraction& sun = light.sun().value();
  if (!sun.found) return {"sun", false, sun.reason, 0};
  const double share = luminance(sun.disk.energy()) / luminance(sun.energy_before);
  return {"sun", true,
          sun.reason + " It holds " + short_number(100 * share) +
              " % of the light, which every other output is without.",
          share};
}

}  // namespace

std::optional<SunOptions> sun_options(const EnvironmentMapsParameters& parameters) {
  if (!parameters.sun) return {};
  return SunOptions{parameters.sun->max_angular_radius_degrees * kPi / 180,
                    parameters.sun->min_contrast};
}

const MapsProduct kSunProduct = {"sun",
                                 "A sun is taken out of the map.",
                                 false,
                                 [](const EnvironmentMapsParameters& parameters) { return parameters.sun.has_value(); },
                                 order_sun,
                                 sun_effect};

}  // namespace lightkiln

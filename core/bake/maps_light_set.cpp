// Directional lights that stand for the map.

#include "core/bake/maps_cost.h"
#include "core/bake/maps_output.h"
#include "core/environment/light_set.h"
#include "core/scene/gltf_lights.h"

namespace lightkiln {

namespace {

constexpr int kMostLights = 256;
constexpr const char* kArtifact = "light_set.gltf";

void write_error(const LightSetError& error, ByteWriter& writer) {
  writer.u64(static_cast<uint64_t>(error.lights));
  writer.f64(error.rms);
  writer.f64(error.max);
}

LightSetError read_error(ByteReader& reader) {
  LightSetError error;
  error.lights = static_cast<int>(reader.u64());
  error.rms = reader.f64();
  error.max = reader.f64();
  return error;
}

class LightSet : public MapsOutput {
 public:
  // `lights` none: the fewest that err by at most `target`.
  LightSet(std::optional<int> lights, double target, double map_texels)
      : lights_(lights), target_(target), map_texels_(map_texels) {}

  double error_bound() const override { return 0; }
  bool bounded() const override { return false; }
  double model_seconds(MapsLight&) const override {
    return kLightSetSeconds + kLightSetPerTexel * map_texels_;
  }

  MeasuredError make(MapsLight& light, int, ByteWriter& writer, Progress& progress) const override {
    const LightCells cells = gather_light(light.environment(), light.threads(), progress);
    const IrradianceReference reference(cells, light.threads(), progress);
    std::vector<LightSetError> table;
    std::vector<DirectionalLight> chosen;
    LightSetError error;
    const auto split = [&](int count) {
      return split_lights(cells, count, LightSplit::clusters, light.threads(), progress);
    };
    const auto measure = [&](const std::vector<DirectionalLight>& lights, int count) {
      const IrradianceError irradiance = reference.error(lights);
      return LightSetError{count, irradiance.rms, irradiance.max};
    };
    bool done = false;
    for (int count = 1; count <= kMostLights; count *= 2) {
      std::vector<DirectionalLight> lights = split(count);
      table.push_back(measure(lights, count));
      const bool last = count == kMostLights;
      if (done || (lights_ ? count != *lights_ : table.back().rms > target_ && !last)) continue;
      done = true;
      error = table.back();
      chosen = std::move(lights);
    }
    if (!done) {
      chosen = split(*lights_);
      error = measure(chosen, *lights_);
    }
    error.lights = static_cast<int>(chosen.size());
    write_error(error, writer);
    writer.u64(table.size());
    for (const LightSetError& row : table) write_error(row, writer);
    for (const DirectionalLight& l : chosen) {
      const Vec3d direction = light.environment().pending.apply(l.direction);
      for (int c = 0; c < 3; ++c) writer.f64(direction[c]);
      for (int c = 0; c < 3; ++c) writer.f64(l.irradiance[c]);
    }
    return {IrradianceReference::kNormals, error.rms, error.max};
  }

  void file(ByteReader& reader, const MeasuredError&, MapsResult* result) const override {
    LightSetDocument set;
    set.artifact = kArtifact;
    set.error = read_error(reader);
    set.by_lights.resize(static_cast<size_t>(reader.u64()));
    for (LightSetError& row : set.by_lights) row = read_error(reader);
    std::vector<GltfDirectionalLight> written;
    for (int i = 0; i < set.error.lights; ++i) {
      DirectionalLight light;
      for (int c = 0; c < 3; ++c) light.direction[c] = reader.f64();
      for (int c = 0; c < 3; ++c) light.irradiance[c] = reader.f64();
      set.energy += light.irradiance;
      written.push_back({"light " + std::to_string(i), light.direction, light.irradiance});
      set.lights.push_back(light);
    }
    result->assembly.artifacts.push_back(
        {kArtifact, "lights", "model/gltf+json",
         write_gltf_lights(written, std::string("Lightkiln ") + kEngineVersion)});
    result->document.light_set = std::move(set);
  }

 private:
  std::optional<int> lights_;
  double target_, map_texels_;
};

// What is ordered is the error of irradiance itself, which is measured: nothing is held back.
void order_light_set(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
                     MapsOutputs* outputs) {
  const Image& map = light.environment().radiance;
  outputs->push_back(std::make_unique<LightSet>(parameters.light_set->lights,
                                                target / working_target(1),
                                                static_cast<double>(map.width) * map.height));
}

}  // namespace

const MapsProduct kLightSetProduct = {
    "light_set", "A set of directional lights is ordered.", true,
    [](const EnvironmentMapsParameters& parameters) { return parameters.light_set.has_value(); },
    order_light_set};

}  // namespace lightkiln

#include "core/scene/gltf_lights.h"

#include <gtest/gtest.h>

#include "core/scene/gltf.h"
#include "core/scene/gltf_json.h"

namespace lightkiln {
namespace {

Scene read_back(const std::vector<GltfDirectionalLight>& lights) {
  const std::vector<std::byte> bytes = write_gltf_lights(lights, "test");
  return load_gltf({bytes, {}}, {});
}

TEST(GltfLights, ComeBackWithTheirDirectionAndIrradiance) {
  const std::vector<GltfDirectionalLight> lights = {
      {"lamp", {0, 0, 1}, {1, 2, 3}},
      {"lamp", {0, 0, -1}, {4, 0, 0}},  // where the shortest turn has no axis of its own
      {"lamp", {1e-9, 0, -1}, {0, 1e-6, 1e-7}},
      {"lamp", {0, 1, 0}, {5e4, 4e4, 3e4}},
      {"lamp", normalize(Vec3d{-0.3, 0.4, 0.5}), {0.1, 0.2, 0.05}},
      {"lamp", normalize(Vec3d{0.3, -0.9, -0.5}), {1, 1, 1}}};
  const Scene scene = read_back(lights);
  ASSERT_EQ(scene.lights.size(), lights.size());
  for (size_t i = 0; i < lights.size(); ++i) {
    const PunctualLight& light = scene.lights[i];
    EXPECT_EQ(light.name, "lamp");
    EXPECT_EQ(light.kind, LightKind::directional);
    for (int c = 0; c < 3; ++c) {
      // Light travels away from where it comes.
      EXPECT_NEAR(light.direction[c], -lights[i].direction[c], 1e-6) << i;
      EXPECT_NEAR(light.intensity[c], lights[i].irradiance[c],
                  1e-6 * std::max(1e-12, lights[i].irradiance[c]))
          << i;
    }
  }
}

TEST(GltfLights, MayBeNone) {
  EXPECT_TRUE(read_back({}).lights.empty());
}

}  // namespace
}  // namespace lightkiln

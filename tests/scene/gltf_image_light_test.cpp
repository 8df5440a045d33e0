#include "core/scene/gltf_image_light.h"

#include <cstring>
#include <string>

#include <gtest/gtest.h>

namespace lightkiln {
namespace {

GltfImageLight two_levels() {
  GltfImageLight light;
  light.name = "sky";
  light.size = 32;
  for (size_t i = 0; i < 9; ++i)
    light.irradiance_coefficients[i] = {static_cast<double>(i), 0.5, -2};
  for (size_t level = 0; level < 2; ++level) {
    auto& faces = light.specular_images.emplace_back();
    for (size_t face = 0; face < 6; ++face)
      faces[face].assign(5 + face, static_cast<std::byte>(16 * level + face));
  }
  return light;
}

std::string json_of(const std::vector<std::byte>& glb) {
  uint32_t length = 0;
  std::memcpy(&length, &glb[12], 4);
  return {reinterpret_cast<const char*>(&glb[20]), length};
}

TEST(GltfImageLight, NamesTwelveImagesLevelByLevel) {
  const std::string json = json_of(write_gltf_image_light(two_levels(), "test"));
  for (const char* part :
       {R"("extensionsUsed":["EXT_lights_image_based"])", R"("specularImageSize":32)",
        R"("specularImages":[[0,1,2,3,4,5],[6,7,8,9,10,11]])", R"("intensity":1)",
        R"("irradianceCoefficients":[[0,0.5,-2],[1,0.5,-2])",
        R"("scenes":[{"name":"sky","extensions":{"EXT_lights_image_based":{"light":0}}}])",
        R"({"buffer":0,"byteOffset":8,"byteLength":6})", R"("generator":"test")"})
    EXPECT_NE(json.find(part), std::string::npos) << part << "\n" << json;
  // The schema's bounds on a rotation are wrong; none is written.
  EXPECT_EQ(json.find("rotation"), std::string::npos);
}

TEST(GltfImageLight, IsAContainerWhoseLengthsAddUp) {
  const auto glb = write_gltf_image_light(two_levels(), "test");
  uint32_t magic = 0, total = 0, json = 0, bin = 0;
  std::memcpy(&magic, &glb[0], 4);
  std::memcpy(&total, &glb[8], 4);
  std::memcpy(&json, &glb[12], 4);
  std::memcpy(&bin, &glb[20 + json], 4);
  EXPECT_EQ(magic, 0x46546c67u);
  EXPECT_EQ(total, glb.size());
  EXPECT_EQ(total, 12 + 8 + json + 8 + bin);
  EXPECT_EQ(glb[20 + json + 8 + 8], std::byte{1});  // the second image stands at byte 8
}

TEST(GltfImageLight, EqualLightsGiveEqualBytes) {
  EXPECT_EQ(write_gltf_image_light(two_levels(), "a"), write_gltf_image_light(two_levels(), "a"));
}

}  // namespace
}  // namespace lightkiln

// Damaged files: any mutation either loads or is refused, and nothing else happens.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/base/error.h"
#include "core/scene/gltf.h"
#include "tests/support/data.h"
#include "tests/support/gltf_builder.h"

using namespace lightkiln;
using namespace lightkiln::test;

namespace {

std::vector<std::vector<std::byte>> seeds() {
  SceneData data;
  Material glow;
  glow.emissive = {4, 4, 4};
  data.parts.push_back({make_box({0, 0, 0}, {1, 1, 1}), glow, {}});
  data.parts.push_back({without_normals(make_floor(2)),
                        {},
                        std::array<double, 16>{1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1}});
  data.lights.push_back({});
  data.lights[0].direction = {0, 0, -1};
  std::vector<std::vector<std::byte>> files = {make_glb(data)};
  if (const auto folder = data_folder()) {
    const auto small = *folder / "scenes/small_features";
    files.push_back(read_file(small / "draco/Box_Draco.glb"));
    files.push_back(read_file(small / "meshopt_quantized/pirate.glb"));
    files.push_back(read_file(small / "simple_skin/SimpleSkin.gltf"));
  }
  return files;
}

// True when it loads; anything but Error escapes and fails the property.
bool survives(const std::vector<std::byte>& file) {
  GltfLoadOptions options;
  options.limits.max_triangles = 200'000;
  try {
    const Scene scene = load_gltf({file, {}}, options);
    const std::vector<float> values([&] {
      size_t count = 0;
      for (const SurfaceMesh& mesh : scene.meshes) count += mesh.positions.size();
      return count;
    }());
    const VertexAttribute attribute{"_AO", values};
    write_glb({file, {}}, scene, std::span(&attribute, 1), "test");
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

TEST(GltfMutations, SeedsLoad) {
  for (const auto& file : seeds()) EXPECT_TRUE(survives(file));
}

RC_GTEST_PROP(GltfMutations, FlippedBytesNeverCrash, ()) {
  static const auto files = seeds();
  auto file = files[*rc::gen::inRange<size_t>(0, files.size())];
  const int flips = *rc::gen::inRange(1, 8);
  for (int i = 0; i < flips; ++i) {
    file[*rc::gen::inRange<size_t>(0, file.size())] =
        static_cast<std::byte>(*rc::gen::inRange(0, 256));
  }
  survives(file);
}

// Digits are where a file states its counts, offsets and indices.
RC_GTEST_PROP(GltfMutations, ChangedNumbersNeverCrash, ()) {
  static const auto files = seeds();
  auto file = files[*rc::gen::inRange<size_t>(0, files.size())];
  std::vector<size_t> digits;
  for (size_t i = 20; i < file.size() && i < 6000; ++i) {
    if (file[i] >= std::byte{'0'} && file[i] <= std::byte{'9'}) digits.push_back(i);
  }
  const int changes = *rc::gen::inRange(1, 4);
  for (int i = 0; i < changes; ++i) {
    file[digits[*rc::gen::inRange<size_t>(0, digits.size())]] =
        static_cast<std::byte>("0123456789-e"[*rc::gen::inRange(0, 12)]);
  }
  survives(file);
}

RC_GTEST_PROP(GltfMutations, TruncationsNeverCrash, ()) {
  static const auto files = seeds();
  auto file = files[*rc::gen::inRange<size_t>(0, files.size())];
  file.resize(*rc::gen::inRange<size_t>(0, file.size()));
  RC_ASSERT(!survives(file));
}

// Small bakes of the demo against pictures that stand beside this file, which an earlier engine
// made. They must agree within the errors that both tell, so that a change of method passes and a
// change of meaning (orientation, units, normalisation, order) does not.
//
// LIGHTKILN_WRITE_GOLDEN=1 writes the pictures anew; look at them before they are committed.

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/sphere/solid_angle.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;

const fs::path kDemo = fs::path(LIGHTKILN_SOURCE_DIR) / "deploy/demo";
const fs::path kGolden = fs::path(LIGHTKILN_SOURCE_DIR) / "tests/golden";

// The demo's scene and sky, and what a spec calls them.
struct Demo {
  std::vector<std::byte> scene = test::read_file(kDemo / "courtyard.glb");
  std::vector<std::byte> sky = test::read_file(kDemo / "sky.hdr");
  InputRef scene_ref{"sha256:" + std::string(64, 'a'), {}};
  InputRef sky_ref{"sha256:" + std::string(64, 'b'), {}};

  Assembly bake(const Spec& spec) const {
    Inputs inputs;
    inputs.blobs[scene_ref.blob] = scene;
    inputs.blobs[sky_ref.blob] = sky;
    Progress progress;
    return bake_all(spec, inputs, {2, 0, 4}, progress);
  }
};

Image image_of(const Assembly& assembly, const std::string& name) {
  for (const Artifact& artifact : assembly.artifacts) {
    if (artifact.name == name) return read_exr(artifact.bytes).image;
  }
  ADD_FAILURE() << "There is no " << name << ".";
  return Image(1, 1, 3);
}

// The stored picture; `made` itself where pictures are written anew.
Image golden(const std::string& name, const Image& made) {
  const fs::path path = kGolden / name;
  if (std::getenv("LIGHTKILN_WRITE_GOLDEN")) {
    ExrWriteOptions options;
    options.pixel_type = ExrPixelType::float32;
    test::write_file(path, write_exr(made, options));
  }
  return read_exr(test::read_file(path)).image;
}

// The root mean square of the difference over the sphere, relative to the golden cube's mean.
double relative_rms(const Image& cube, const Image& truth) {
  const int size = truth.width;
  double squares = 0, sum = 0;
  for (int y = 0; y < 6 * size; ++y) {
    for (int x = 0; x < size; ++x) {
      const double omega = cube_texel_solid_angle(x, y % size, size) / (4 * kPi);
      const double a = luminance(to_double(cube.rgb(x, y)));
      const double b = luminance(to_double(truth.rgb(x, y)));
      squares += omega * (a - b) * (a - b);
      sum += omega * b;
    }
  }
  return std::sqrt(squares) / sum;
}

// Every face in its neighbour's place: what no tolerance may let pass.
Image misplaced(const Image& cube) {
  Image moved = cube;
  const auto face = static_cast<std::ptrdiff_t>(3) * cube.width * cube.width;
  std::rotate(moved.pixels.begin(), moved.pixels.begin() + face, moved.pixels.end());
  return moved;
}

TEST(Golden, OpennessOfTheCourtyard) {
  const Demo demo;
  Spec spec;
  spec.scene = demo.scene_ref;
  AmbientOcclusionParameters parameters;
  parameters.max_distance = 6;
  parameters.falloff = Falloff::smooth;
  spec.parameters = parameters;
  spec.accuracy.target_error = 0.05;
  const Assembly result = demo.bake(spec);
  const Image made = image_of(result, "ambient_occlusion.exr");
  const Image errors = image_of(result, "ambient_occlusion_error.exr");
  const Image stored = golden("courtyard_openness.exr", made);
  ASSERT_EQ(made.pixels.size(), stored.pixels.size());
  const auto count = std::get<AoDocument>(result.document).vertices;
  size_t outside = 0;
  double bias = 0, contrast = 0;
  for (size_t i = 0; i < count; ++i) {
    const double difference = double{made.pixels[i]} - stored.pixels[i];
    outside += std::abs(difference) > 0.05 + errors.pixels[i];
    bias += difference / static_cast<double>(count);
    contrast += std::abs(double{stored.pixels[i]} - stored.pixels[(i + count / 2) % count]) /
                static_cast<double>(count);
  }
  EXPECT_LE(static_cast<double>(outside), 0.01 * static_cast<double>(count));
  EXPECT_LT(std::abs(bias), 0.005);
  EXPECT_GT(contrast, 0.1);  // the picture could tell vertices apart
}

TEST(Golden, ReflectionsOfTheSky) {
  const Demo demo;
  Spec spec;
  spec.environment = demo.sky_ref;
  EnvironmentMapsParameters parameters;
  parameters.prefilter = PrefilterOutput{.size = 16, .levels = 3};
  spec.parameters = parameters;
  const Assembly result = demo.bake(spec);
  for (const char* level : {"0", "1", "2"}) {
    const Image made = image_of(result, std::string("prefilter_") + level + ".exr");
    const Image stored = golden(std::string("sky_level_") + level + ".exr", made);
    ASSERT_EQ(made.pixels.size(), stored.pixels.size());
    EXPECT_LT(relative_rms(made, stored), 2e-3) << level;  // twice the order
    EXPECT_GT(relative_rms(misplaced(made), stored), 4e-3) << level;
  }
}

TEST(Golden, LightInTheCourtyard) {
  const Demo demo;
  Spec spec;
  spec.scene = demo.scene_ref;
  spec.environment = demo.sky_ref;
  ProbesParameters parameters;
  parameters.positions = {{0, 1.6, -3.3}};
  parameters.cubemap.size = 8;
  spec.parameters = parameters;
  spec.accuracy.target_error = 0.1;
  const Assembly result = demo.bake(spec);
  const ProbeDocument& probe = std::get<ProbesDocument>(result.document).probes.at(0);
  const Image made = image_of(result, probe.radiance_artifact);
  const Image stored = golden("courtyard_radiance.exr", made);
  ASSERT_EQ(made.pixels.size(), stored.pixels.size());
  EXPECT_LT(relative_rms(made, stored), 0.1 + probe.error);
  EXPECT_GT(relative_rms(misplaced(made), stored), 0.1 + probe.error);
}

}  // namespace
}  // namespace lightkiln

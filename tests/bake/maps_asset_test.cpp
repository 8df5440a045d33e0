// The glTF asset: its faces hold the levels, its coefficients the irradiance, its document what
// packing lost.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/environment/lookup_cube.h"
#include "core/image/exr.h"
#include "core/image/rgbd.h"
#include "core/sphere/direction_map.h"
#include "tests/bake/maps_orders.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

Assembly bake(const Image& map, const EnvironmentMapsParameters& parameters, Plan* plan = nullptr,
              int threads = 1) {
  Spec spec = test::order(parameters);
  spec.accuracy.check_texels = 2;
  return test::bake(spec, test::exr_of(map), threads, plan);
}

const AssetDocument& document_of(const Assembly& assembly) {
  return *std::get<EnvironmentDocument>(assembly.document).asset;
}

const std::vector<std::byte>& bytes_of(const Assembly& assembly, const std::string& name) {
  for (const Artifact& artifact : assembly.artifacts)
    if (artifact.name == name) return artifact.bytes;
  throw std::runtime_error("no artifact " + name);
}

// The PNG files of a GLB in their order.
std::vector<Image8> images_of(const std::vector<std::byte>& glb) {
  std::vector<Image8> images;
  const std::byte magic[] = {std::byte{0x89}, std::byte{'P'}, std::byte{'N'}, std::byte{'G'}};
  for (auto at = glb.begin(); at != glb.end();) {
    at = std::search(at, glb.end(), magic, magic + 4);
    if (at == glb.end()) break;
    images.push_back(read_ldr(std::span(glb).subspan(static_cast<size_t>(at - glb.begin()))));
    at += 8;
  }
  return images;
}

// Red, green and blue tell x, y and z of the direction.
Image directions(int height) {
  Image map(2 * height, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / map.width, (y + 0.5) / height);
      const Vec3 rgb = to_float(Vec3d{0.5, 0.5, 0.5} + d * 0.5);
      std::copy_n(&rgb.x, 3, map.at(x, y));
    }
  }
  return map;
}

// What a graphics interface finds along `d` in a cube map (OpenGL 4.6, table 8.19) whose images
// were stored bottom row first.
Vec3d look_up(const std::vector<Image8>& faces, const Vec3d& d) {
  const double ax = std::abs(d.x), ay = std::abs(d.y), az = std::abs(d.z);
  size_t face = 0;
  double s = 0, t = 0, major = 0;
  if (ax >= ay && ax >= az) {
    face = d.x > 0 ? 0 : 1, s = d.x > 0 ? -d.z : d.z, t = -d.y, major = ax;
  } else if (ay >= az) {
    face = d.y > 0 ? 2 : 3, s = d.x, t = d.y > 0 ? d.z : -d.z, major = ay;
  } else {
    face = d.z > 0 ? 4 : 5, s = d.z > 0 ? d.x : -d.x, t = -d.y, major = az;
  }
  const Image8& image = faces[face];
  const int x = std::min(static_cast<int>((s / major + 1) / 2 * image.width), image.width - 1);
  const int y = std::min(static_cast<int>((t / major + 1) / 2 * image.width), image.width - 1);
  const int row = image.width - 1 - y;
  return decode_rgbd(&image.pixels[4 * static_cast<size_t>(row * image.width + x)]);
}

TEST(MapsAsset, PutsEveryDirectionWhereViewersLook) {
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{32, AssetRoughness::linear};
  const Assembly result = bake(directions(128), parameters);
  const std::vector<Image8> images = images_of(bytes_of(result, "environment.glb"));
  ASSERT_EQ(images.size(), 12u);
  EXPECT_EQ(images[0].width, 32);
  EXPECT_EQ(images[6].width, 16);
  double mirrored = 0;
  for (int i = 0; i < 500; ++i) {
    const double z = 1 - (2 * i + 1) / 500.0, turn = 2.399963 * i, r = std::sqrt(1 - z * z);
    const Vec3d ours = {r * std::cos(turn), r * std::sin(turn), z};
    // The left-handed world of the viewer.
    const Vec3d seen = look_up(images, {-ours.x, ours.y, ours.z});
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen[c], 0.5 + 0.5 * ours[c], 0.04) << i << ' ' << c;
    mirrored = std::max(mirrored, std::abs(look_up(images, ours).x - (0.5 + 0.5 * ours.x)));
  }
  EXPECT_GT(mirrored, 0.5);  // looked up as it is, the world is mirrored
}

TEST(MapsAsset, HoldsTheLevelsOfTheChainAndTellsWhatPackingChanged) {
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{64, AssetRoughness::linear};
  parameters.prefilter = PrefilterOutput{64, 3};
  Plan plan;
  const Assembly result = bake(reference::test_sky(64, 1e4), parameters, &plan);
  const AssetDocument& document = document_of(result);
  double worst_share = 0;  // of a texel's largest channel
  const auto& chain = std::get<EnvironmentDocument>(result.document).prefilter;
  const std::vector<Image8> images = images_of(bytes_of(result, document.artifact));
  const double mean = luminance(std::get<EnvironmentDocument>(result.document).mean);
  ASSERT_EQ(document.levels.size(), 3u);
  ASSERT_EQ(images.size(), 18u);
  for (size_t l = 0; l < 3; ++l) {
    const AssetLevelDocument& level = document.levels[l];
    EXPECT_EQ(level.roughness, 0.5 * static_cast<double>(l));
    EXPECT_EQ(level.error_bound, chain[l].error_bound);
    const Image cube = read_exr(bytes_of(result, chain[l].artifact)).image;
    double squares = 0, largest = 0;
    uint64_t cut = 0;
    for (int face = 0; face < 6; ++face) {
      const Image expected = lookup_face(cube, face);
      const Image8& image = images[6 * l + static_cast<size_t>(face)];
      for (size_t i = 0; i < expected.pixels.size() / 3; ++i) {
        Vec3d truth{expected.pixels[3 * i], expected.pixels[3 * i + 1], expected.pixels[3 * i + 2]};
        const double top = std::max({truth.x, truth.y, truth.z});
        if (top > 255) truth *= 255 / top, ++cut;
        const Vec3d error = decode_rgbd(&image.pixels[4 * i]) - truth;
        squares += dot(error, error);
        const double most = std::max({std::abs(error.x), std::abs(error.y), std::abs(error.z)});
        largest = std::max(largest, most);
        if (top > 1 && top <= 255) worst_share = std::max(worst_share, most / top);
      }
    }
    EXPECT_EQ(level.cut_texels, cut);
    EXPECT_EQ(level.cut_share > 0, cut > 0);
    const double count = static_cast<double>(cube.pixels.size());
    EXPECT_NEAR(level.packing_rms, std::sqrt(squares / count) / mean, 1e-9);
    EXPECT_NEAR(level.packing_max, largest / mean, 1e-9);
    EXPECT_GT(level.packing_rms, 0);
  }
  EXPECT_GT(document.levels[0].cut_texels, 0u);  // the sun of 1e4
  // No order reaches packing, and the plan says by how much.
  const auto asset = std::find_if(plan.effects.begin(), plan.effects.end(),
                                  [](const Effect& effect) { return effect.name == "asset"; });
  ASSERT_NE(asset, plan.effects.end());
  EXPECT_EQ(asset->bound, kRgbdStep);
  EXPECT_LE(worst_share, kRgbdStep);
  EXPECT_GT(worst_share, 0.5 * kRgbdStep);
}

TEST(MapsAsset, WarnsOfWhatTheFormatCannotHold) {
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{32, AssetRoughness::linear};
  Plan bright, dim;
  bake(reference::test_sky(32, 1e4), parameters, &bright);
  ASSERT_EQ(bright.warnings.size(), 1u);
  EXPECT_NE(bright.warnings[0].find("hold at most 255"), std::string::npos);
  const Assembly quiet = bake(directions(16), parameters, &dim);
  EXPECT_TRUE(dim.warnings.empty());
  EXPECT_EQ(document_of(quiet).levels[0].cut_texels, 0u);
}

// The JSON of a GLB.
std::string json_of(const Assembly& assembly) {
  const auto& glb = bytes_of(assembly, "environment.glb");
  uint32_t length = 0;
  std::memcpy(&length, &glb[12], 4);
  return {reinterpret_cast<const char*>(&glb[20]), length};
}

// The nine coefficients that viewers read.
std::vector<Vec3d> coefficients_of(const Assembly& assembly) {
  const std::string json = json_of(assembly), key = "\"irradianceCoefficients\":[";
  const char* at = json.c_str() + json.find(key) + key.size();
  std::vector<Vec3d> all(9);
  for (Vec3d& c : all) {
    for (int channel = 0; channel < 3; ++channel) {
      char* end = nullptr;
      c[channel] = std::strtod(at + 1, &end);  // past [ or ,
      at = end;
    }
    at += 2;  // past ],
  }
  return all;
}

TEST(MapsAsset, WindowsItsCoefficientsAsThoseOfTheMap) {
  const Image sky = reference::test_sky(32, 1e5);
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{32, AssetRoughness::linear};
  const std::vector<Vec3d> plain = coefficients_of(bake(sky, parameters));
  EXPECT_FALSE(document_of(bake(sky, parameters)).sh_window);
  for (const ShWindow window : {ShWindow::hann, ShWindow::lanczos, ShWindow::minimal}) {
    parameters.asset->window = window;
    parameters.sh = ShOutput{3, window};
    parameters.sh->exports = 1u << static_cast<int>(ShTarget::ext_lights_image_based);
    const Assembly result = bake(sky, parameters);
    const auto& document = std::get<EnvironmentDocument>(result.document);
    ASSERT_TRUE(document.asset->sh_window);
    const ShWindowReport &own = *document.asset->sh_window, &sh = *document.sh_window;
    EXPECT_EQ(own.window, window);
    EXPECT_EQ(own.quantity, ShQuantity::irradiance);
    EXPECT_EQ(own.factors, sh.factors);
    EXPECT_EQ(own.energy_removed, sh.energy_removed);
    EXPECT_EQ(own.contrast_removed, sh.contrast_removed);
    EXPECT_EQ(own.before.lowest, sh.before.lowest);
    EXPECT_EQ(own.after.lowest, sh.after.lowest);
    EXPECT_LT(own.before.lowest, -0.01);  // a sun in three bands leaves negative light
    if (window == ShWindow::minimal) {
      EXPECT_GE(own.after.lowest, -2e-6);
    }
    const std::vector<Vec3d> windowed = coefficients_of(result);
    for (size_t i = 0; i < 9; ++i) {
      const size_t band = i == 0 ? 0 : i < 4 ? 1 : 2;
      const double scale = length(plain[0]);
      EXPECT_LT(length(windowed[i] - plain[i] * own.factors[band]), 1e-12 * scale) << i;
      EXPECT_LT(length(windowed[i] - document.sh_exports.at(0).coefficients[i]), 1e-12 * scale);
    }
    EXPECT_EQ(windowed[0], plain[0]);
  }
}

// Its images are the same: a window is of the coefficients.
TEST(MapsAsset, AWindowLeavesItsImagesAloneAndAConstantMapWhole) {
  EnvironmentMapsParameters plain, windowed;
  plain.asset = AssetOutput{32};
  windowed.asset = AssetOutput{32, AssetRoughness::linear, ShWindow::minimal};
  const Image sky = directions(16);
  const auto images = [&](const EnvironmentMapsParameters& parameters) {
    std::vector<std::vector<uint8_t>> all;
    for (const Image8& image : images_of(bytes_of(bake(sky, parameters), "environment.glb")))
      all.push_back(image.pixels);
    return all;
  };
  EXPECT_EQ(images(plain), images(windowed));
  Image map(8, 4, 3);
  std::fill(map.pixels.begin(), map.pixels.end(), 1.0f);
  const Assembly result = bake(map, windowed);
  EXPECT_EQ(bytes_of(result, "environment.glb"), bytes_of(bake(map, plain), "environment.glb"));
  EXPECT_EQ(document_of(result).sh_window->contrast_removed, 0);
}

TEST(MapsAsset, OfAWhiteFurnaceIsOneEverywhere) {
  Image map(8, 4, 3);
  std::fill(map.pixels.begin(), map.pixels.end(), 1.0f);
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{};
  const Assembly result = bake(map, parameters);
  const auto& glb = bytes_of(result, "environment.glb");
  for (const Image8& image : images_of(glb))
    for (const uint8_t value : image.pixels) ASSERT_EQ(value, 255);
  // Irradiance pi: pi 2 sqrt(pi) = 11.136656 at 00, nothing above.
  EXPECT_NE(json_of(result).find("\"irradianceCoefficients\":[[11.13665599"), std::string::npos);
  EXPECT_EQ(document_of(result).levels.size(), 5u);  // 256 128 64 32 16
  EXPECT_EQ(document_of(result).levels[4].roughness, 1);
}

// Babylon.js looks up level log2(size alpha) (levels - 1) / log2(size).
TEST(MapsAsset, HoldsTheRoughnessThatItsViewerLooksUp) {
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{64, AssetRoughness::babylon};
  const Assembly result = bake(directions(16), parameters);
  const auto& levels = document_of(result).levels;
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0].roughness, 0);
  for (size_t l = 1; l < 3; ++l) {
    const double alpha = levels[l].roughness * levels[l].roughness;
    EXPECT_NEAR(std::log2(64 * alpha) * 2 / std::log2(64.0), static_cast<double>(l), 1e-12);
  }
}

TEST(MapsAsset, GivesTheSameBytesForAnyThreads) {
  EnvironmentMapsParameters parameters;
  parameters.asset = AssetOutput{32, AssetRoughness::babylon};
  const Image sky = reference::test_sky(32, 100);
  const Assembly one = bake(sky, parameters), two = bake(sky, parameters, nullptr, 2);
  EXPECT_EQ(bytes_of(one, "environment.glb"), bytes_of(two, "environment.glb"));
}

TEST(MapsAsset, RefusesSizesThatDoNotHalveToSixteen) {
  for (const int size : {16, 48, 2048}) {
    Spec spec;
    spec.environment = InputRef{test::kDigest, {}};
    EnvironmentMapsParameters parameters;
    parameters.asset = AssetOutput{size, AssetRoughness::linear};
    spec.parameters = parameters;
    const std::vector<SpecFault> faults = validate(spec);
    ASSERT_EQ(faults.size(), 1u) << size;
    EXPECT_EQ(faults[0].pointer, "/parameters/asset/size");
    EXPECT_NE(faults[0].message.find("powers of two from 32 to 1024"), std::string::npos);
  }
}

}  // namespace
}  // namespace lightkiln

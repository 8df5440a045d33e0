#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/bake/maps_output.h"
#include "core/image/exr.h"
#include "core/image/radiance_hdr.h"
#include "core/image/shrink.h"
#include "core/sphere/direction_map.h"
#include "tests/bake/maps_orders.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::bake;
using test::document_of;
using test::exr_of;
using test::kDigest;
using test::order;

EnvironmentMapsParameters everything() {
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{5};
  parameters.irradiance = IrradianceOutput{.size = 8};
  parameters.prefilter = PrefilterOutput{.size = 32, .levels = 4};
  parameters.dfg = DfgOutput{.size = 16};
  return parameters;
}

Image image_of(const Assembly& assembly, const std::string& name) {
  for (const Artifact& artifact : assembly.artifacts) {
    if (artifact.name == name) return read_exr(artifact.bytes).image;
  }
  ADD_FAILURE() << "no artifact " << name;
  return Image(1, 1, 3);
}

const Effect& effect_of(const Plan& plan, const std::string& name) {
  const auto found = std::find_if(plan.effects.begin(), plan.effects.end(),
                                  [&](const Effect& effect) { return effect.name == name; });
  if (found == plan.effects.end()) throw std::runtime_error("no effect " + name);
  return *found;
}

Image constant_map(float value) {
  Image map(32, 16, 3);
  for (float& v : map.pixels) v = value;
  return map;
}

TEST(EnvironmentMaps, BakesAWhiteFurnaceToExactlyOne) {
  Plan plan;
  const Assembly result = bake(order(everything()), exr_of(constant_map(1)), 1, &plan);
  EXPECT_FALSE(effect_of(plan, "environment_variation").active);
  EXPECT_EQ(effect_of(plan, "environment_variation").bound, 0);
  for (int level = 0; level < 4; ++level) {
    for (const float v : image_of(result, "prefilter_" + std::to_string(level) + ".exr").pixels) {
      ASSERT_EQ(v, 1.0f);
    }
  }
  for (const float v : image_of(result, "irradiance.exr").pixels) {
    ASSERT_EQ(v, static_cast<float>(kPi));
  }
  const EnvironmentDocument& document = document_of(result);
  EXPECT_NEAR(document.sh->sh.coefficients[0].x, 2 * std::sqrt(kPi), 1e-14);
  for (size_t i = 1; i < 25; ++i) EXPECT_EQ(document.sh->sh.coefficients[i], Vec3d{});
  EXPECT_EQ(result.accuracy.status, AccuracyStatus::exact);
  EXPECT_EQ(result.accuracy.counters.projected_texels, 0u);
  EXPECT_EQ(result.accuracy.counters.cube_texels, 0u);
}

// The furnace of the general path: one texel off by a hair switches the closed form off.
TEST(EnvironmentMaps, ChangesNothingWhenTheClosedFormIsOff) {
  Image map = constant_map(1);
  map.at(3, 4)[1] = std::nextafter(1.0f, 2.0f);
  Plan plan;
  const Assembly result = bake(order(everything()), exr_of(map), 1, &plan);
  EXPECT_TRUE(effect_of(plan, "environment_variation").active);
  for (int level = 0; level < 4; ++level) {
    for (const float v : image_of(result, "prefilter_" + std::to_string(level) + ".exr").pixels) {
      ASSERT_NEAR(v, 1.0f, 1e-6f);
    }
  }
  for (const float v : image_of(result, "irradiance.exr").pixels) {
    ASSERT_NEAR(v, static_cast<float>(kPi), 1e-5f);
  }
  EXPECT_EQ(result.accuracy.counters.projected_texels, 32u * 16);
  EXPECT_GT(result.accuracy.counters.cube_texels, 0u);
}

TEST(EnvironmentMaps, MakesOnlyWhatIsOrdered) {
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{3};
  Plan plan;
  const Assembly result = bake(order(parameters), exr_of(reference::test_sky(16, 10)), 1, &plan);
  EXPECT_EQ(plan.elements, 1u);
  EXPECT_EQ(plan.max_samples, 3u);  // bands of the map that were transformed
  EXPECT_TRUE(result.artifacts.empty());
  EXPECT_TRUE(document_of(result).prefilter.empty());
  EXPECT_FALSE(document_of(result).irradiance.has_value());
  EXPECT_TRUE(effect_of(plan, "sh").active);
  // Nine coefficients pass over the map once and build no cube.
  EXPECT_EQ(result.accuracy.counters.projected_texels, 32u * 16);
  EXPECT_EQ(result.accuracy.counters.cube_texels, 0u);
  parameters.prefilter = PrefilterOutput{8, 2};
  const Assembly more = bake(order(parameters), exr_of(reference::test_sky(16, 10)));
  EXPECT_EQ(more.accuracy.counters.projected_texels, 32u * 16);
  EXPECT_EQ(more.accuracy.counters.cube_texels, 6u * (64 + 16));
  for (const char* name : {"irradiance", "prefilter", "dfg", "bright_texels"}) {
    EXPECT_FALSE(effect_of(plan, name).active) << name;
    EXPECT_FALSE(effect_of(plan, name).reason.empty()) << name;
  }
}

TEST(EnvironmentMaps, OrdersTheSameCoefficientsAloneOrWithTheRest) {
  EnvironmentMapsParameters alone;
  alone.sh = ShOutput{5};
  const auto file = exr_of(reference::test_sky(32, 100));
  const ShRgb a = document_of(bake(order(alone), file)).sh->sh;
  const ShRgb b = document_of(bake(order(everything()), file)).sh->sh;
  for (size_t i = 0; i < 25; ++i) {
    EXPECT_NEAR(length(a.coefficients[i] - b.coefficients[i]), 0, 1e-7 * length(a.coefficients[0]));
  }
}

TEST(EnvironmentMaps, WritesChainIrradianceAndTableThatReadBack) {
  Plan plan;
  const Image sky = reference::test_sky(64, 1e5);
  const Assembly result = bake(order(everything()), exr_of(sky), 2, &plan);
  const EnvironmentDocument& document = document_of(result);
  ASSERT_EQ(document.prefilter.size(), 4u);
  EXPECT_EQ(document.prefilter[0].roughness, 0);
  EXPECT_EQ(document.prefilter[3].roughness, 1);
  EXPECT_EQ(document.prefilter[3].size, 4);
  EXPECT_EQ(document.source_width, 128);
  EXPECT_TRUE(effect_of(plan, "bright_texels").active);
  EXPECT_GT(effect_of(plan, "bright_texels").bound, plan.prices[4].error * 0.1);
  const Image rough = image_of(result, "prefilter_3.exr");
  ASSERT_EQ(rough.height, 24);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 4; ++x) {
      const Vec3d d = cube_texel_direction(y / 4, x, y % 4, 4);
      const Vec3d truth = reference::irradiance(sky, d) / kPi;
      EXPECT_NEAR(rough.rgb(x, y).y, truth.y, 2e-4 * luminance(document.mean));
    }
  }
  const Image irradiance = image_of(result, "irradiance.exr");
  const Vec3d d = cube_texel_direction(2, 3, 5, 8);
  EXPECT_NEAR(irradiance.rgb(3, 21).x / reference::irradiance(sky, d).x, 1, 3e-4);
  const Image dfg = image_of(result, "dfg.exr");
  const double roughness = 9.5 / 16;
  const reference::Dfg value = reference::dfg(roughness * roughness, 12.5 / 16, 600);
  EXPECT_NEAR(dfg.rgb(12, 9).x, value.scale, 1e-4);
  EXPECT_NEAR(dfg.rgb(12, 9).y, value.bias, 1e-4);
  EXPECT_EQ(dfg.rgb(12, 9).z, 0.0f);
  ASSERT_EQ(document.sh->selftest.size(), 6u);
  for (const ShSelftest& test : document.sh->selftest) {
    EXPECT_EQ(test.radiance, sh_evaluate(document.sh->sh, test.direction));
  }
}

TEST(EnvironmentMaps, StatesBoundsAndPrices) {
  const Assembly result = bake(order(everything()), exr_of(reference::test_sky(64, 1e4)));
  const AccuracyRecord& accuracy = result.accuracy;
  EXPECT_EQ(accuracy.status, AccuracyStatus::exact);
  EXPECT_EQ(accuracy.elements, 7u);
  EXPECT_EQ(accuracy.converged_share, 1);
  EXPECT_LE(accuracy.error_max, 0.001);
  ASSERT_EQ(accuracy.time_to_error.size(), 5u);
  for (size_t i = 1; i < 5; ++i) {
    EXPECT_GE(accuracy.time_to_error[i].samples, accuracy.time_to_error[i - 1].samples);
    EXPECT_GT(accuracy.time_to_error[i].seconds, 0);
  }
  EXPECT_GT(accuracy.time_to_error[4].samples, accuracy.time_to_error[0].samples);
}

// Every output of the general path is held against its twin, and none errs by more than was
// ordered; a closed form has nothing to measure.
TEST(EnvironmentMaps, MeasuresItsErrorAgainstTheTwin) {
  Spec spec = order(everything());
  spec.accuracy.check_texels = 6;
  const Assembly result = bake(spec, exr_of(reference::test_sky(64, 1e5)), 2);
  const EnvironmentDocument& document = document_of(result);
  EXPECT_EQ(document.sh_measured.count, 6u);
  EXPECT_LE(document.sh_measured.max, document.sh->error);
  std::vector<MapDocument> maps = document.prefilter;
  maps.push_back(*document.irradiance);
  maps.push_back(*document.dfg);
  for (const MapDocument& map : maps) {
    EXPECT_EQ(map.measured.count, 6u) << map.artifact;
    EXPECT_LE(map.measured.rms, 1e-3) << map.artifact;
    EXPECT_GE(map.measured.max, map.measured.rms) << map.artifact;
    EXPECT_GT(map.measured.max, 0) << map.artifact;
  }
  spec.accuracy.check_texels = 0;
  EXPECT_EQ(document_of(bake(spec, exr_of(constant_map(2)))).prefilter[1].measured.count, 0u);
}

// One group of outputs at an order: what is stated, what is seen and what it is priced at.
struct Ordered {
  double bound = 0;
  MeasuredError measured;
  double price_coarse = 0, price_fine = 0;  // at 0.1 and at 0.001, before the bake
};
Ordered at_order(const EnvironmentMapsParameters& parameters, double target) {
  Spec spec = order(parameters);
  spec.accuracy.target_error = target;
  spec.accuracy.check_texels = 4;
  Plan plan;
  const Assembly result = bake(spec, exr_of(reference::test_sky(64, 50)), 1, &plan);
  EXPECT_EQ(result.accuracy.status, AccuracyStatus::exact) << target;
  Ordered seen;
  seen.bound = result.accuracy.error_max;
  const EnvironmentDocument& document = document_of(result);
  if (document.dfg) seen.measured = document.dfg->measured;
  if (document.irradiance) seen.measured = document.irradiance->measured;
  if (document.sh) seen.measured = document.sh_measured;
  for (const auto* chain : {&document.prefilter, &document.sheen}) {
    for (const MapDocument& level : *chain)
      if (level.measured.rms > seen.measured.rms) seen.measured = level.measured;
  }
  seen.price_coarse = plan.prices.front().seconds;
  seen.price_fine = plan.prices.back().seconds;
  return seen;
}

// What is ordered is what is kept, of each output, and a finer order states less, errs no more and
// costs more: orders are not decoration.
TEST(EnvironmentMaps, KeepEveryOrderAndPriceItByWhatItTakes) {
  EnvironmentMapsParameters dfg, irradiance, chain, sheen, sh;
  dfg.dfg = DfgOutput{.size = 32, .charlie = true};
  irradiance.irradiance = IrradianceOutput{.size = 8, .method = IrradianceMethod::exact};
  chain.prefilter = PrefilterOutput{.size = 16, .levels = 3};
  sheen.sheen = PrefilterOutput{.size = 16, .levels = 2};
  sheen.sheen->roughness_scale = RoughnessScale::custom;
  sheen.sheen->roughness = {0.4, 1};
  sh.sh = ShOutput{9};
  for (const auto* parameters : {&dfg, &irradiance, &chain, &sheen, &sh}) {
    const Ordered coarse = at_order(*parameters, 0.1), fine = at_order(*parameters, 1e-3);
    for (const auto& [seen, target] : {std::pair{coarse, 0.1}, {fine, 1e-3}}) {
      EXPECT_LE(seen.bound, target);
      EXPECT_LE(seen.measured.rms, seen.bound);
      EXPECT_LE(seen.measured.max, target);
    }
    EXPECT_LE(fine.bound, (parameters == &sh ? 1 : 0.2) * coarse.bound);
    // Nine bands of a small map are one pass over it at any order, and more points a row at a
    // finer.
    const double least = parameters == &sh ? 1 : 1.3;
    EXPECT_GE(fine.price_fine, least * fine.price_coarse) << parameters - &dfg;
  }
}

// The map itself on a cube is exact but for rounding to float, which a sun makes large against the
// mean: level 0's bound knows the map.
TEST(EnvironmentMaps, StateWhatRoundingLeavesOfTheMapItself) {
  EnvironmentMapsParameters parameters;
  parameters.prefilter = PrefilterOutput{.size = 16, .levels = 2};
  double last = 0;
  for (const double sun : {10.0, 1e6}) {
    Spec spec = order(parameters);
    spec.accuracy.check_texels = 0;
    const Image sky = reference::test_sky(64, sun);
    const EnvironmentDocument document = document_of(bake(spec, exr_of(sky)));
    const double bound = document.prefilter[0].error_bound;
    EXPECT_LT(bound, 1e-4);
    EXPECT_GT(bound, last);
    last = bound;
  }
  EXPECT_GT(last, 1e-6);
}

// The default order's coefficients err by at most 1e-6 of L00, and a table of 1e-5 by at most that.
TEST(EnvironmentMaps, KeepTheFiguresOfCoefficientsAndTables) {
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{3};
  Spec spec = order(parameters);
  spec.accuracy.check_texels = 9;
  const auto sky = exr_of(reference::test_sky(256, 1e5));
  const EnvironmentDocument document = document_of(bake(spec, sky));
  EXPECT_LE(document.sh->error, 1e-6);
  EXPECT_LE(document.sh_measured.max, document.sh->error);
  EnvironmentMapsParameters table;
  table.dfg = DfgOutput{.size = 64, .charlie = true};
  spec = order(table);
  spec.accuracy.target_error = 1e-5;
  spec.accuracy.check_texels = 64;
  const EnvironmentDocument exact = document_of(bake(spec, sky));
  EXPECT_LE(exact.dfg->error_bound, 1e-5);
  EXPECT_LE(exact.dfg->measured.max, exact.dfg->error_bound);
}

TEST(MapsOutput, MeasuresTheChannelThatErrsMost) {
  ErrorMeter meter(2, 0.01);
  EXPECT_EQ(meter.result().count, 0u);
  meter.add({1, 0.5, 0}, {0, 0, 0});
  meter.add({0, 1.5, 0.25}, {0, 0.5, 0});
  const MeasuredError seen = meter.result();
  EXPECT_EQ(seen.count, 2u);
  EXPECT_DOUBLE_EQ(seen.rms, std::sqrt((0.0625 + 0.25) / 2));
  EXPECT_DOUBLE_EQ(seen.max, 0.5);
  EXPECT_DOUBLE_EQ(seen.twin, 0.005);
}

TEST(MapsOutput, IsSuspiciousWhenWhatIsSeenBreaksWhatWasPromised) {
  ChunkReport report;
  Round round;
  judge_output(1e-4, {4, 2e-5, 3e-5}, 1e-3, &report, &round);
  EXPECT_EQ(round.converged, 1u);
  judge_output(1e-4, {4, 6e-4, 2e-3}, 1e-3, &report, &round);
  EXPECT_EQ(report.suspicious, 1u);
  judge_output(1e-4, {4, 6e-4, 2e-3, 1.1e-3}, 1e-3, &report, &round);  // so much the twin may err
  EXPECT_EQ(report.suspicious, 1u);
  judge_output(1e-2, {4, 2e-5, 3e-5}, 1e-3, &report, &round);
  EXPECT_EQ(report.budget_limited, 1u);
  EXPECT_EQ(round.converged, 2u);
  EXPECT_DOUBLE_EQ(round.error_max, 1e-2);
  EXPECT_DOUBLE_EQ(round.error_sum_sq, 1e-8 + 2 * 36e-8 + 1e-4);
}

TEST(EnvironmentMaps, SaysWhenAnOrderCannotBeReached) {
  EnvironmentMapsParameters parameters;
  parameters.irradiance = IrradianceOutput{.size = 2};
  Spec spec = order(parameters);
  spec.accuracy.target_error = 1e-9;
  const Assembly result = bake(spec, exr_of(reference::test_sky(16, 1e4)));
  EXPECT_EQ(result.accuracy.status, AccuracyStatus::budget_limited);
  EXPECT_GT(result.accuracy.error_max, 1e-9);
}

TEST(EnvironmentMaps, GivesASmallPictureOfEachImage) {
  EnvironmentMapsParameters parameters;
  parameters.prefilter = PrefilterOutput{.size = 128, .levels = 3};
  parameters.sheen = PrefilterOutput{.size = 16, .levels = 2, .packaging = Packaging::mip_mapped};
  parameters.dfg = DfgOutput{.size = 16};
  const Assembly result = bake(order(parameters), exr_of(reference::test_sky(24, 10)));
  std::vector<std::string> images, shown;
  for (const Artifact& artifact : result.artifacts) {
    if (artifact.media_type == "image/x-exr") images.push_back(artifact.name);
  }
  for (const Picture& picture : result.pictures) {
    shown.push_back(picture.artifact);
    const Image whole = image_of(result, picture.artifact);
    EXPECT_EQ(picture.pixels.pixels, shrink(whole, kPictureSide).pixels) << picture.artifact;
    EXPECT_LE(picture.pixels.height, kPictureSide);
  }
  EXPECT_EQ(shown, images);
  EXPECT_EQ(shown.size(), 5u);
}

TEST(EnvironmentMaps, GivesPicturesOfTheFirstImagesOnly) {
  Assembly assembly;
  const int all = static_cast<int>(kMostPictures) + 2;
  for (int i = 0; i < all; ++i) add_image(std::to_string(i), Image(4, 2, 3), {}, &assembly);
  EXPECT_EQ(assembly.artifacts.size(), kMostPictures + 2);
  ASSERT_EQ(assembly.pictures.size(), kMostPictures);
  EXPECT_EQ(assembly.pictures.back().artifact, std::to_string(kMostPictures - 1));
}

std::vector<std::vector<std::byte>> bytes_of(const Assembly& assembly) {
  std::vector<std::vector<std::byte>> bytes;
  for (const Artifact& artifact : assembly.artifacts) bytes.push_back(artifact.bytes);
  return bytes;
}

TEST(EnvironmentMaps, GivesTheSameBytesForAnyThreadsAndChunks) {
  const auto file = exr_of(reference::test_sky(24, 1e3));
  const Spec spec = order(everything());
  const Assembly one = bake(spec, file, 1);
  for (const int threads : {2, 8}) EXPECT_EQ(bytes_of(one), bytes_of(bake(spec, file, threads)));

  Inputs inputs;
  inputs.blobs[kDigest] = file;
  Grants grants;
  grants.threads = 2;
  Progress progress;
  Plan plan = Bake(spec, inputs, grants).plan(progress);
  plan.chunks.clear();
  for (uint64_t i = 0; i < plan.elements; ++i) plan.chunks.push_back({i, 1});
  std::vector<ChunkResult> results(plan.chunks.size());
  // Out of order, each in an oven of its own.
  for (size_t i = plan.chunks.size(); i-- > 0;) {
    results[i] = Bake(spec, inputs, grants).chunk(plan, plan.chunks[i], progress);
  }
  const Assembly split = Bake(spec, inputs, grants).assemble(plan, results, progress);
  EXPECT_EQ(bytes_of(one), bytes_of(split));
  EXPECT_EQ(document_of(one).sh->sh.coefficients, document_of(split).sh->sh.coefficients);
}

TEST(EnvironmentMaps, CountsRepairsAndBakesTheCleanedMap) {
  Image clean = reference::test_sky(16, 10), dirty = clean;
  for (int i = 0; i < 3; ++i) {
    std::fill_n(clean.at(i, 2), 3, 0.0f);
    std::copy_n(clean.at(i, 2), 3, dirty.at(i, 2));
  }
  dirty.at(0, 2)[0] = NAN;
  dirty.at(1, 2)[1] = INFINITY;
  dirty.at(2, 2)[2] = -1;
  Plan plan;
  const Assembly a = bake(order(everything()), exr_of(dirty), 1, &plan);
  const Assembly b = bake(order(everything()), exr_of(clean));
  EXPECT_EQ(bytes_of(a), bytes_of(b));
  const std::vector<std::pair<std::string, uint64_t>> expected = {
      {"nan_pixels", 1}, {"infinite_pixels", 1}, {"negative_pixels", 1}};
  EXPECT_EQ(plan.repairs, expected);
}

TEST(EnvironmentMaps, BakesABlackMapToZeroAndSaysSo) {
  Plan plan;
  const Assembly result = bake(order(everything()), exr_of(constant_map(0)), 1, &plan);
  ASSERT_EQ(plan.warnings.size(), 1u);
  for (const float v : image_of(result, "prefilter_2.exr").pixels) ASSERT_EQ(v, 0.0f);
}

ErrorCode refusal(const std::vector<std::byte>& file) {
  try {
    bake(order(everything()), file);
  } catch (const Error& error) {
    EXPECT_GT(std::string(error.what()).size(), 20u);
    return error.code();
  }
  return ErrorCode::internal;
}

TEST(EnvironmentMaps, RefusesWhatIsNoEnvironmentMap) {
  EXPECT_EQ(refusal(exr_of(Image(48, 32, 3))), ErrorCode::invalid_input);
  EXPECT_EQ(refusal(exr_of(Image(8, 40, 3), EnvmapAttribute::cube)), ErrorCode::invalid_input);
  EXPECT_EQ(refusal({std::byte{1}, std::byte{2}}), ErrorCode::invalid_input);
}

TEST(EnvironmentMaps, StopsWhenCancelled) {
  Inputs inputs;
  const auto file = exr_of(reference::test_sky(32, 1));
  inputs.blobs[kDigest] = file;
  Progress progress;
  Bake opened(order(everything()), inputs, Grants{});
  const Plan plan = opened.plan(progress);
  progress.cancel();
  EXPECT_THROW(opened.chunk(plan, plan.chunks[0], progress), Error);
}

}  // namespace
}  // namespace lightkiln

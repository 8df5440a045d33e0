#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/bake/maps_output.h"
#include "core/image/decode.h"
#include "core/image/exr.h"
#include "core/scene/gltf.h"
#include "tests/bake/maps_orders.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::bake;
using test::document_of;
using test::exr_of;
using test::order;

const Artifact* artifact_of(const Assembly& assembly, const std::string& name) {
  for (const Artifact& artifact : assembly.artifacts) {
    if (artifact.name == name) return &artifact;
  }
  return nullptr;
}

const Effect& effect_of(const Plan& plan, const std::string& name) {
  const auto found = std::find_if(plan.effects.begin(), plan.effects.end(),
                                  [&](const Effect& effect) { return effect.name == name; });
  if (found == plan.effects.end()) throw std::runtime_error("no effect " + name);
  return *found;
}

EnvironmentMapsParameters maps() {
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{5};
  parameters.irradiance = IrradianceOutput{8};
  parameters.prefilter = PrefilterOutput{32, 3};
  return parameters;
}

Image sunny_map() {
  return reference::test_sky(128, 1e5);
}

void expect_equal_artifacts(const Assembly& a, const Assembly& b) {
  for (const Artifact& artifact : a.artifacts) {
    const Artifact* other = artifact_of(b, artifact.name);
    ASSERT_NE(other, nullptr) << artifact.name;
    EXPECT_EQ(artifact.bytes, other->bytes) << artifact.name;
  }
}

TEST(MapsSun, LeavesOthersTheMapWithoutIt) {
  const Image map = sunny_map();
  DecodedImage decoded;
  decoded.image = map;
  Environment rest = make_environment(decoded);
  ASSERT_TRUE(extract_sun(rest, {}).found);

  EnvironmentMapsParameters with = maps();
  with.sun = SunOrder{};
  Plan plan;
  const Assembly sunless = bake(order(with), exr_of(map), 1, &plan);
  const Assembly of_rest = bake(order(maps()), exr_of(rest.radiance));
  expect_equal_artifacts(of_rest, sunless);
  EXPECT_EQ(document_of(of_rest).sh->sh.coefficients, document_of(sunless).sh->sh.coefficients);
  EXPECT_EQ(sunless.artifacts.size(), of_rest.artifacts.size() + 1);
  EXPECT_TRUE(effect_of(plan, "sun").active);
  EXPECT_GT(effect_of(plan, "sun").bound, 0.5);

  // Whole = rest + sun, as the document gives them.
  const Assembly whole = bake(order(maps()), exr_of(map));
  const EnvironmentDocument& document = document_of(sunless);
  ASSERT_TRUE(document.sun && document.sun->found);
  EXPECT_EQ(document.sun_sh.bands, 5);
  const auto& all = document_of(whole).sh->sh.coefficients;
  for (size_t i = 0; i < 9; ++i) {
    const Vec3d sum = document.sh->sh.coefficients[i] + document.sun_sh.coefficients[i];
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], all[i][c], 1e-3 * all[0][c]) << i;
  }
  EXPECT_NEAR(document.sh->sh.coefficients[0].x + document.sun_sh.coefficients[0].x, all[0].x,
              1e-6 * all[0].x);
  EXPECT_EQ(document.sun_measured.count, 1u);
  EXPECT_LT(document.sun_measured.max, 1e-9);
  // The document's source is the file.
  EXPECT_EQ(document.max_luminance, document_of(whole).max_luminance);
  EXPECT_NEAR(document.mean.x, document_of(whole).mean.x, 1e-12 * document.mean.x);
  const Artifact* lamp = artifact_of(sunless, "sun.gltf");
  ASSERT_NE(lamp, nullptr);
  const Scene scene = load_gltf({lamp->bytes, {}}, {});
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_NEAR(dot(scene.lights[0].direction, document.sun->disk.direction), -1, 1e-9);
  EXPECT_NEAR(scene.lights[0].intensity.x, document.sun->disk.irradiance().x,
              1e-6 * document.sun->disk.irradiance().x);
}

TEST(MapsSun, ChangesNothingOnAMapWithoutOne) {
  Image map = sunny_map();
  for (float& v : map.pixels) v = std::min(v, 1.5f);
  EnvironmentMapsParameters with = maps();
  with.sun = SunOrder{};
  Plan plan;
  const Assembly a = bake(order(with), exr_of(map), 1, &plan), b = bake(order(maps()), exr_of(map));
  EXPECT_EQ(a.artifacts.size(), b.artifacts.size());
  expect_equal_artifacts(a, b);
  EXPECT_EQ(document_of(a).sh->sh.coefficients, document_of(b).sh->sh.coefficients);
  EXPECT_FALSE(effect_of(plan, "sun").active);
  EXPECT_EQ(effect_of(plan, "sun").bound, 0);
  EXPECT_EQ(effect_of(plan, "sun").reason, document_of(a).sun->reason);
  EXPECT_FALSE(document_of(a).sun->found);
  EXPECT_FALSE(document_of(b).sun);
}

// Layouts are otherwise converted from the file's own pixels, which still hold the sun.
TEST(MapsSun, IsGoneFromEveryLayoutOfATurnedMap) {
  EnvironmentMapsParameters parameters;
  parameters.rotation.yaw_degrees = 33;
  for (size_t product = 0; product < kLayoutProducts; ++product) {
    const std::string name = layout_product_name(product);
    if (name != "latlong" && name != "octahedral") continue;
    parameters.layouts[product].emplace();
    parameters.layouts[product]->size = 128;
  }
  const auto brightest = [&](const Assembly& assembly, const char* name) {
    const Image image = read_exr(artifact_of(assembly, name)->bytes).image;
    return *std::max_element(image.pixels.begin(), image.pixels.end());
  };
  const Assembly whole = bake(order(parameters), exr_of(sunny_map()));
  parameters.sun = SunOrder{};
  const Assembly rest = bake(order(parameters), exr_of(sunny_map()));
  ASSERT_TRUE(document_of(rest).sun->found);
  for (const char* name : {"layout_latlong.exr", "layout_octahedral.exr"}) {
    EXPECT_GT(brightest(whole, name), 1000) << name;
    // The sun is taken out of the file's own texels, and what is left is turned.
    EXPECT_LT(brightest(rest, name), 2) << name;
  }
  EnvironmentMapsParameters unturned = parameters;
  unturned.rotation = {};
  const Assembly still = bake(order(unturned), exr_of(sunny_map()));
  EXPECT_LT(length(document_of(rest).sun->disk.direction -
                   yaw_rotation(33).apply(document_of(still).sun->disk.direction)),
            1e-12);
  // The document tells the file as it is.
  EXPECT_EQ(document_of(rest).source_width, document_of(whole).source_width);
  EXPECT_FALSE(document_of(rest).rotation.is_identity());
}

TEST(MapsSun, CanBeOrderedAlone) {
  EnvironmentMapsParameters parameters;
  parameters.sun = SunOrder{};
  const Assembly result = bake(order(parameters), exr_of(sunny_map()));
  EXPECT_TRUE(document_of(result).sun->found);
  EXPECT_EQ(document_of(result).sun_sh.bands, 3);
  EXPECT_EQ(result.artifacts.size(), 1u);
  EXPECT_EQ(result.accuracy.status, AccuracyStatus::exact);
}

// A map that is a sun before one radiance everywhere leaves nothing but closed forms.
TEST(MapsSun, LeavesAConstantMapInClosedForm) {
  Image map(64, 32, 3);
  for (float& v : map.pixels) v = 0.5f;
  std::fill_n(map.at(20, 7), 3, 1e6f);
  EnvironmentMapsParameters with = maps();
  with.sun = SunOrder{.max_angular_radius_degrees = 5};
  Plan plan;
  const Assembly result = bake(order(with), exr_of(map), 1, &plan);
  EXPECT_FALSE(effect_of(plan, "environment_variation").active);
  EXPECT_NEAR(document_of(result).sh->sh.coefficients[0].x, std::sqrt(kPi), 1e-12);
}

TEST(MapsLightSet, ConservesEnergyAndStatesItsError) {
  EnvironmentMapsParameters parameters;
  parameters.light_set = LightSetOutput{12};
  const Assembly result = bake(order(parameters), exr_of(sunny_map()));
  const LightSetDocument& set = document_of(result).light_set.value();
  ASSERT_EQ(set.lights.size(), 12u);
  for (int c = 0; c < 3; ++c) {
    const double whole = document_of(result).mean[c] * 4 * kPi;
    EXPECT_NEAR(set.energy[c], whole, 1e-12 * whole);
  }
  ASSERT_EQ(set.by_lights.size(), 9u);
  for (size_t i = 0; i < 9; ++i) EXPECT_EQ(set.by_lights[i].lights, 1 << i);
  EXPECT_LT(set.by_lights[4].rms, set.error.rms);
  EXPECT_LT(set.error.rms, set.by_lights[3].rms);
  // Twelve lights cannot give what the order asks for, and the record says so.
  EXPECT_EQ(result.accuracy.status, AccuracyStatus::budget_limited);
  EXPECT_EQ(result.accuracy.error_rms, set.error.rms);
  const Scene scene = load_gltf({artifact_of(result, "light_set.gltf")->bytes, {}}, {});
  ASSERT_EQ(scene.lights.size(), 12u);
  Vec3d sum;
  for (const PunctualLight& light : scene.lights) sum += to_double(light.intensity);
  EXPECT_NEAR(sum.y, set.energy.y, 1e-6 * set.energy.y);
}

TEST(MapsLightSet, TakesTheFewestLightsThatReachTheOrder) {
  Spec spec = order({});
  std::get<EnvironmentMapsParameters>(spec.parameters).light_set.emplace();
  spec.accuracy.target_error = 0.02;
  const Assembly result = bake(spec, exr_of(sunny_map()));
  const LightSetDocument& set = document_of(result).light_set.value();
  EXPECT_EQ(result.accuracy.status, AccuracyStatus::exact);
  EXPECT_LE(set.error.rms, 0.02);
  for (const LightSetError& row : set.by_lights) {
    EXPECT_EQ(row.rms <= 0.02, row.lights >= set.error.lights);
  }
  spec.accuracy.target_error = 1e-9;
  const Assembly beyond = bake(spec, exr_of(sunny_map()));
  EXPECT_EQ(document_of(beyond).light_set->lights.size(), 256u);
  EXPECT_EQ(beyond.accuracy.status, AccuracyStatus::budget_limited);
}

TEST(MapsLightSet, IsEmptyForABlackMap) {
  EnvironmentMapsParameters parameters;
  parameters.light_set = LightSetOutput{4};
  const Assembly result = bake(order(parameters), exr_of(Image(16, 8, 3)));
  EXPECT_TRUE(document_of(result).light_set->lights.empty());
  EXPECT_EQ(document_of(result).light_set->error.max, 0);
  EXPECT_TRUE(load_gltf({artifact_of(result, "light_set.gltf")->bytes, {}}, {}).lights.empty());
}

}  // namespace
}  // namespace lightkiln

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/harmonic_rotation.h"
#include "core/sphere/map_layout.h"
#include "tests/bake/maps_orders.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

using test::exr_of;

struct Baked {
  Assembly assembly;
  Plan plan;

  const EnvironmentDocument& document() const {
    return std::get<EnvironmentDocument>(assembly.document);
  }
  const Artifact& artifact(const std::string& name) const {
    for (const Artifact& one : assembly.artifacts) {
      if (one.name == name) return one;
    }
    throw std::runtime_error("no artifact " + name);
  }
  const Effect& effect(const std::string& name) const {
    for (const Effect& one : plan.effects) {
      if (one.name == name) return one;
    }
    throw std::runtime_error("no effect " + name);
  }
};

Baked bake(const EnvironmentMapsParameters& parameters, const std::vector<std::byte>& file,
           std::optional<double> error = {}) {
  Spec spec = test::order(parameters);
  spec.accuracy.target_error = error;
  EXPECT_TRUE(validate(spec).empty());
  Baked baked;
  baked.assembly = test::bake(spec, file, 0, &baked.plan);
  return baked;
}

LayoutOutput sized(int size) {
  LayoutOutput output;
  output.size = size;
  return output;
}

EnvironmentMapsParameters all_layouts() {
  EnvironmentMapsParameters parameters;
  for (size_t i = 0; i < kLayoutProducts; ++i) {
    LayoutOutput output = default_layout_output(i);
    output.size = output.size == 256 ? 16 : output.size == 512 ? 32 : 64;
    parameters.layouts[i] = output;
  }
  return parameters;
}

TEST(Layouts, WritesEveryLayoutAndSaysWhatItLost) {
  const Baked baked = bake(all_layouts(), exr_of(reference::test_sky(32, 10)));
  ASSERT_EQ(baked.document().layouts.size(), kLayoutProducts);
  EXPECT_EQ(baked.assembly.artifacts.size(), kLayoutProducts + 5);
  for (const LayoutDocument& entry : baked.document().layouts) {
    for (const std::string& name : entry.artifacts) {
      const DecodedImage image = read_exr(baked.artifact(name).bytes);
      EXPECT_EQ(image.envmap, EnvmapAttribute::none);
      EXPECT_EQ(image.image.width, entry.layout.width);
    }
    ASSERT_TRUE(entry.round_trip) << entry.name;
    EXPECT_LT(entry.round_trip->relative_rms, 0.5) << entry.name;
    // Held against the twin, but for the map itself.
    EXPECT_EQ(entry.measured.count, entry.error_bound > 0 ? 4u : 0u) << entry.name;
    EXPECT_LT(entry.measured.rms, 2e-3) << entry.name;
    const bool half = entry.name.starts_with("hemisphere");
    EXPECT_NEAR(entry.round_trip->not_covered_share,
                half                       ? 0.5
                : entry.name == "cylinder" ? 1 - std::sin(std::atan(kPi / 2))
                                           : 0,
                1e-12)
        << entry.name;
  }
  // The same size: the map itself.
  EXPECT_EQ(baked.document().layouts[0].round_trip->relative_rms, 0);
  EXPECT_EQ(baked.document().layouts[0].error_bound, 0);
  EXPECT_FALSE(baked.effect("rotation").active);
  EXPECT_FALSE(baked.effect("source_layout").active);
  EXPECT_FALSE(baked.effect("harmonic_transform").active);
}

// An order is the bound, it sets the work, and the plan says so before.
TEST(Layouts, AreMadeToTheOrderedError) {
  const auto file = exr_of(reference::test_sky(64, 100));
  EnvironmentMapsParameters parameters;
  parameters.layouts[size_t(LayoutKind::angular)] = sized(96);
  const Baked fine = bake(parameters, file, 1e-4), coarse = bake(parameters, file, 0.03);
  EXPECT_LT(fine.document().layouts[0].error_bound, 1e-4);
  EXPECT_LT(coarse.document().layouts[0].error_bound, 0.03);
  EXPECT_GT(coarse.document().layouts[0].error_bound, 1e-3);
  EXPECT_GT(fine.document().layouts[0].measured.count, 0u);
  EXPECT_LE(fine.document().layouts[0].measured.rms, coarse.document().layouts[0].measured.rms);
  ASSERT_EQ(fine.plan.prices.size(), 5u);
  EXPECT_GT(fine.plan.prices.back().seconds, fine.plan.prices.front().seconds);
  EXPECT_NE(fine.artifact("layout_angular.exr").bytes, coarse.artifact("layout_angular.exr").bytes);
}

TEST(Layouts, WritesTheEnvmapAttributeExactlyWithItsConvention) {
  EnvironmentMapsParameters parameters = all_layouts();
  for (const size_t i : {size_t{0}, size_t{1}}) {
    parameters.layouts[i]->texel_convention = TexelConvention::openexr;
  }
  const Baked baked = bake(parameters, exr_of(reference::test_sky(32, 10)));
  EXPECT_EQ(read_exr(baked.artifact("layout_latlong.exr").bytes).envmap, EnvmapAttribute::latlong);
  EXPECT_EQ(read_exr(baked.artifact("layout_cube_strip.exr").bytes).envmap, EnvmapAttribute::cube);
  EXPECT_EQ(read_exr(baked.artifact("layout_octahedral.exr").bytes).envmap, EnvmapAttribute::none);
}

// Strip to cross, cross to six files, and back: the same bits.
TEST(Layouts, MovesFacesWithoutTouchingThem) {
  Image strip(8, 48, 3);
  for (size_t i = 0; i < strip.pixels.size(); ++i) strip.pixels[i] = 0.1f + float(i % 977);
  EnvironmentMapsParameters parameters;
  parameters.source.layout = LayoutKind::cube_strip;
  parameters.layouts[size_t(LayoutKind::horizontal_cross)] = sized(8);
  const Baked cross = bake(parameters, exr_of(strip));
  parameters = {};
  parameters.source.layout = LayoutKind::horizontal_cross;
  parameters.layouts[size_t(LayoutKind::cube_strip)] = sized(8);
  parameters.layouts[kCubeFaces] = sized(8);
  const Baked back = bake(parameters, cross.artifact("layout_horizontal_cross.exr").bytes);
  EXPECT_EQ(read_exr(back.artifact("layout_cube_strip.exr").bytes).image.pixels, strip.pixels);
  const char* names[] = {"px", "nx", "py", "ny", "pz", "nz"};
  for (int face = 0; face < 6; ++face) {
    const Image part =
        read_exr(back.artifact(std::string("layout_cube_faces_") + names[face] + ".exr").bytes)
            .image;
    EXPECT_TRUE(std::equal(part.pixels.begin(), part.pixels.end(), strip.at(0, 8 * face)))
        << names[face];
  }
  EXPECT_TRUE(back.effect("source_layout").active);
}

// A map read from any layout feeds every other product.
TEST(Layouts, BakesTheSameCoefficientsFromEveryLayout) {
  const Image sky = reference::test_sky(64, 5);
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{};
  for (size_t i = 0; i < kCubeFaces; ++i) {
    parameters.layouts[i] = default_layout_output(i);
  }
  parameters.layouts[size_t(LayoutKind::mirror_ball)]->distance = 4;
  const Baked first = bake(parameters, exr_of(sky));
  const ShRgb& truth = first.document().sh->sh;
  for (size_t i = 0; i < kCubeFaces; ++i) {
    const MapLayout layout = layout_of(i, *parameters.layouts[i]);
    if (covered_solid_angle(layout) < 4 * kPi * 0.97) continue;
    EnvironmentMapsParameters again;
    again.sh = ShOutput{};
    again.source.layout = layout.kind;
    again.source.distance = parameters.layouts[i]->distance;
    const Baked second =
        bake(again, first.artifact(first.document().layouts[i].artifacts[0]).bytes);
    const bool ball = layout.kind == LayoutKind::mirror_ball;  // it hides 1.6 % of the sphere
    for (size_t k = 0; k < 9; ++k) {
      EXPECT_LT(length(second.document().sh->sh.coefficients[k] - truth.coefficients[k]),
                (ball ? 0.1 : 3e-3) * length(truth.coefficients[0]))
          << layout_name(layout.kind) << " " << k;
    }
    EXPECT_EQ(second.effect("source_coverage").active, ball);
  }
}

TEST(Layouts, TurnsEveryOutputAlike) {
  const auto file = exr_of(reference::test_sky(64, 5));
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{};
  parameters.layouts[size_t(LayoutKind::octahedral)] = sized(48);
  parameters.layouts[size_t(LayoutKind::cube_strip)] = sized(8);
  parameters.irradiance = IrradianceOutput{8, IrradianceMethod::harmonics, 3};
  parameters.prefilter = PrefilterOutput{8, 2};
  parameters.light_set = LightSetOutput{4};
  const Baked still = bake(parameters, file);
  EnvironmentMapsParameters same = parameters;
  same.rotation.quaternion = {0, 0, 0, -3};
  const Baked unturned = bake(same, file);
  EXPECT_EQ(unturned.artifact("layout_octahedral.exr").bytes,
            still.artifact("layout_octahedral.exr").bytes);
  EXPECT_EQ(unturned.document().sh->sh.coefficients, still.document().sh->sh.coefficients);
  for (const bool yaw : {true, false}) {
    EnvironmentMapsParameters turned = parameters;
    if (yaw)
      turned.rotation.yaw_degrees = 31;
    else
      turned.rotation.quaternion = {0.2, -0.4, 0.1, 0.6};
    const Rotation rotation = rotation_of(turned.rotation);
    const Baked baked = bake(turned, file);
    EXPECT_TRUE(baked.effect("rotation").active);
    const ShRgb exact = sh_rotate(still.document().sh->sh, rotation.rows);
    double difference = 0;
    for (size_t i = 0; i < 9; ++i) {
      EXPECT_LT(length(baked.document().sh->sh.coefficients[i] - exact.coefficients[i]),
                1e-9 * length(exact.coefficients[0]));
      difference = std::max(
          difference, length(still.document().sh->sh.coefficients[i] - exact.coefficients[i]));
    }
    EXPECT_GT(difference, 0.01 * length(exact.coefficients[0]));  // the turn shows
    // Cubes and lights stand where the coefficients say.
    const Image irradiance = read_exr(baked.artifact("irradiance.exr").bytes).image;
    const Image level = read_exr(baked.artifact("prefilter_0.exr").bytes).image;
    const Image strip = read_exr(baked.artifact("layout_cube_strip.exr").bytes).image;
    const double mean = luminance(baked.document().mean);
    for (int line = 0; line < irradiance.height; ++line) {
      for (int x = 0; x < irradiance.width; ++x) {
        const Vec3d truth = sh_irradiance(exact, cube_texel_direction(line / 8, x, line % 8, 8));
        EXPECT_LT(length(to_double(irradiance.rgb(x, line)) - truth), 1e-4 * kPi * mean);
        EXPECT_LT(length(to_double(level.rgb(x, line)) - to_double(strip.rgb(x, line))),
                  5e-3 * length(to_double(strip.rgb(x, line))) + 5e-3 * mean);
      }
    }
    const auto moment = [](const Baked& one) {
      Vec3d sum;
      for (const DirectionalLight& light : one.document().light_set->lights)
        sum += light.direction * luminance(light.irradiance);
      return sum;
    };
    EXPECT_LT(length(moment(baked) - rotation.apply(moment(still))), 1e-9 * mean);
  }
}

TEST(Layouts, RefusesWhatDoesNotFitBeforeAnyFileIsOpened) {
  Spec spec;
  spec.environment = InputRef{test::kDigest, {}};
  EnvironmentMapsParameters parameters;
  parameters.source.layout = LayoutKind::octahedral;
  parameters.source.distance = 3;
  parameters.source.mirrored = true;
  parameters.source.texel_convention = TexelConvention::openexr;
  parameters.rotation.yaw_degrees = 10;
  parameters.rotation.quaternion = {1, 0, 0, 0};
  parameters.layouts[0] = sized(63);
  parameters.layouts[kCubeFaces] = sized(4096);
  parameters.layouts[size_t(LayoutKind::mirror_ball)] = sized(64);
  parameters.layouts[size_t(LayoutKind::mirror_ball)]->distance = 1.0;
  spec.parameters = parameters;
  std::vector<std::string> pointers;
  for (const SpecFault& fault : validate(spec)) pointers.push_back(fault.pointer);
  for (const char* pointer :
       {"/parameters/source/distance", "/parameters/source/mirrored",
        "/parameters/source/texel_convention", "/parameters/rotation/yaw_degrees",
        "/parameters/layouts/latlong/width", "/parameters/layouts/cube_faces/size",
        "/parameters/layouts/mirror_ball/distance"}) {
    EXPECT_NE(std::find(pointers.begin(), pointers.end(), pointer), pointers.end()) << pointer;
  }
}

}  // namespace
}  // namespace lightkiln

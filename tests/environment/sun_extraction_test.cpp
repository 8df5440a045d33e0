#include "core/environment/sun_extraction.h"

#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "core/environment/prefilter.h"
#include "core/sphere/quadrature.h"
#include "tests/environment/made_maps.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::energy_of;
using test::environment_of;
using test::map_of;
using test::paint_disk;

constexpr double kDegree = kPi / 180;

double angle(const Vec3d& a, const Vec3d& b) {
  return std::atan2(length(cross(a, b)), dot(a, b));
}

// A blue sky that brightens towards the horizon.
Image sky_of(int height) {
  Image map(2 * height, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double up = std::cos(kPi * (y + 0.5) / height);
      const double bright = up > 0 ? 1.5 - up : 0.3;
      const Vec3 value = to_float(Vec3d{0.5, 0.7, 1.0} * bright);
      std::copy_n(&value.x, 3, map.at(x, y));
    }
  }
  return map;
}

// Whole = rest + sun in every channel, where the test sums all three itself; no texel grew or went
// below zero; texels farther than the source reaches kept their bytes.
void expect_whole(const Image& before, const Environment& rest, const SunExtraction& sun) {
  ASSERT_TRUE(sun.found) << sun.reason;
  const Vec3d whole = energy_of(before), left = energy_of(rest.radiance);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(left[c] + sun.disk.energy()[c], whole[c], 1e-5 * whole[c]) << c;
    EXPECT_NEAR(sun.energy_before[c], whole[c], 1e-9 * whole[c]);
    EXPECT_NEAR(sun.energy_after[c], left[c], 1e-9 * whole[c]);
    EXPECT_NEAR(rest.mean[c], left[c] / (4 * kPi), 1e-9 * whole[c]);
  }
  uint64_t changed = 0;
  for (int y = 0; y < before.height; ++y) {
    for (int x = 0; x < before.width; ++x) {
      const Vec3 a = before.rgb(x, y), b = rest.radiance.rgb(x, y);
      EXPECT_TRUE(b.x <= a.x && b.y <= a.y && b.z <= a.z);
      EXPECT_TRUE(b.x >= 0 && b.y >= 0 && b.z >= 0);
      if (a == b) continue;
      ++changed;
      const Vec3d d = latlong_direction((x + 0.5) / before.width, (y + 0.5) / before.height);
      EXPECT_LE(angle(d, sun.disk.direction), sun.extent_rad + 1e-9);
    }
  }
  EXPECT_LE(changed, sun.texels);
  EXPECT_GT(changed, 0u);
}

void expect_untouched(const Image& before, const SunOptions& options = {}) {
  Environment environment = environment_of(before);
  const Environment copy = environment;
  const SunExtraction sun = extract_sun(environment, options);
  EXPECT_FALSE(sun.found);
  EXPECT_FALSE(sun.reason.empty());
  EXPECT_EQ(environment.radiance.pixels, copy.radiance.pixels);
  EXPECT_EQ(environment.mean, copy.mean);
  EXPECT_EQ(environment.max_luminance, copy.max_luminance);
  EXPECT_EQ(sun.energy_before, sun.energy_after);
  EXPECT_EQ(sun.disk.energy(), Vec3d{});
}

TEST(Sun, GivesBackThePaintedDisk) {
  const Vec3 radiance{20000, 18000, 12000};
  for (const double radius : {0.6, 1.0, 2.0}) {
    for (const Vec3d& where :
         {Vec3d{0.3, 0.6, 0.5}, Vec3d{-0.2, 0.97, 0.1}, Vec3d{0.8, 0.1, 0.1}}) {
      Image map = sky_of(512);
      paint_disk(&map, where, radius * kDegree, radiance);
      Environment rest = environment_of(map);
      const SunExtraction sun = extract_sun(rest, {});
      expect_whole(map, rest, sun);
      EXPECT_LT(angle(sun.disk.direction, normalize(where)), 0.01 * kDegree);
      // A texel on the rim is covered by any share c: what int l^2 / int l misses there, c - c^2,
      // averages 1/6 over a band 4/pi texels wide, which widens the radius by 0.21 texels; a
      // texel's sides lie between a row's height and that times sin theta.
      const double texel = 180.0 / map.height,
                   wider = sun.disk.angular_radius_rad / kDegree - radius;
      EXPECT_GT(wider, 0.1 * texel);
      EXPECT_LT(wider, 0.25 * texel);
      EXPECT_NEAR(sun.disk.energy().x, cap_solid_angle(radius * kDegree) * double(radiance.x),
                  0.01 * sun.disk.energy().x);
      EXPECT_LT(rest.max_luminance, 2);  // the sky's own
    }
  }
}

TEST(Sun, FillsTheHoleWithWhatSurroundsIt) {
  const Image sky = sky_of(256);
  Image map = sky;
  paint_disk(&map, {0.3, 0.6, 0.5}, 1.5 * kDegree, {9000, 9000, 9000});
  Environment rest = environment_of(map);
  ASSERT_TRUE(extract_sun(rest, {}).found);
  for (size_t i = 0; i < sky.pixels.size(); ++i) {
    EXPECT_NEAR(rest.radiance.pixels[i], sky.pixels[i], 0.02) << i;
  }
}

TEST(Sun, TakesOneTexelAsADiskOfItsSolidAngle) {
  for (const int row : {0, 20, 63}) {
    Image map = map_of(64, {0.5f, 0.5f, 0.5f});
    map.at(127, row)[1] = 1e6f;
    SunOptions options;
    Environment rest = environment_of(map);
    const SunExtraction sun = extract_sun(rest, options);
    expect_whole(map, rest, sun);
    EXPECT_EQ(sun.texels, 1u);
    const double solid_angle = latlong_texel_solid_angle(row, 128, 64);
    EXPECT_NEAR(cap_solid_angle(sun.disk.angular_radius_rad), solid_angle, 1e-9 * solid_angle);
    EXPECT_LT(angle(sun.disk.direction, latlong_direction(127.5 / 128, (row + 0.5) / 64)), 0.02);
    EXPECT_EQ(sun.disk.radiance.x, 0);
    EXPECT_NEAR(sun.disk.radiance.y, 1e6 - 0.5, 1);
    // What is left has one radiance everywhere, and says so.
    EXPECT_TRUE(rest.constant);
    EXPECT_EQ(rest.mean.y, 0.5);
  }
}

TEST(Sun, IsTheSameAcrossTheSeamAndTurnsWithTheMap) {
  Image map = sky_of(256);
  paint_disk(&map, {0.02, 0.4, -1}, 1.2 * kDegree, {5000, 4000, 3000});  // at u = 0
  Environment rest = environment_of(map);
  const SunExtraction sun = extract_sun(rest, {});
  expect_whole(map, rest, sun);
  Image turned(map.width, map.height, 3);
  const int shift = 200;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      std::copy_n(map.at(x, y), 3, turned.at((x + shift) % map.width, y));
    }
  }
  Environment turned_rest = environment_of(turned);
  const SunExtraction other = extract_sun(turned_rest, {});
  expect_whole(turned, turned_rest, other);
  EXPECT_EQ(other.texels, sun.texels);
  EXPECT_NEAR(other.disk.angular_radius_rad, sun.disk.angular_radius_rad, 1e-12);
  const double turn = -2 * kPi * shift / map.width;  // longitude falls as u grows
  const Vec3d& d = sun.disk.direction;
  const Vec3d expected{d.x * std::cos(turn) + d.z * std::sin(turn), d.y,
                       d.z * std::cos(turn) - d.x * std::sin(turn)};
  EXPECT_LT(angle(other.disk.direction, expected), 1e-9);
}

TEST(Sun, StandsAtThePole) {
  for (const double side : {1.0, -1.0}) {
    for (const double tilt : {0.0, 0.006}) {
      Image map = map_of(256, {0.4f, 0.5f, 0.6f});
      const Vec3d where{tilt, side, 0};
      paint_disk(&map, where, 1.0 * kDegree, {8000, 8000, 8000});
      Environment rest = environment_of(map);
      const SunExtraction sun = extract_sun(rest, {});
      expect_whole(map, rest, sun);
      EXPECT_LT(angle(sun.disk.direction, normalize(where)), 0.02 * kDegree);
      // Rows of 0.7 degrees end the disk anywhere: up to half a row wider.
      EXPECT_GT(sun.disk.angular_radius_rad, 1.0 * kDegree);
      EXPECT_LT(sun.disk.angular_radius_rad, 1.35 * kDegree);
    }
  }
}

// A camera that stops at 20 leaves a plateau; the cloud on the other side stops there too and is
// larger.
TEST(Sun, IsFoundClippedBesideAClippedCloud) {
  Image map = map_of(256, {1, 1, 1});
  paint_disk(&map, {-0.5, 0.3, -0.8}, 9 * kDegree, {20, 20, 20});
  expect_untouched(map);
  paint_disk(&map, {0.4, 0.7, 0.6}, 1.5 * kDegree, {20, 20, 20});
  Environment rest = environment_of(map);
  const SunExtraction sun = extract_sun(rest, {});
  expect_whole(map, rest, sun);
  EXPECT_LT(angle(sun.disk.direction, normalize(Vec3d{0.4, 0.7, 0.6})), 0.02 * kDegree);
  EXPECT_NEAR(sun.disk.angular_radius_rad, 1.5 * kDegree, 0.1 * kDegree);
}

TEST(Sun, IsCutOffTheBrightCloudItTouches) {
  Image map = sky_of(256);
  const Vec3d where{0.3, 0.5, 0.6};
  paint_disk(&map, Vec3d{0.42, 0.5, 0.6}, 8 * kDegree, {60, 60, 60});
  paint_disk(&map, where, 1.0 * kDegree, {20000, 20000, 20000});
  Environment rest = environment_of(map);
  const SunExtraction sun = extract_sun(rest, {});
  expect_whole(map, rest, sun);
  EXPECT_LT(angle(sun.disk.direction, normalize(where)), 0.03 * kDegree);
  EXPECT_LT(sun.extent_rad, 2.6 * kDegree);
  EXPECT_GT(rest.max_luminance, 55);  // the cloud stays
  EXPECT_LT(rest.max_luminance, 130);
}

TEST(Sun, TakesOnlyTheBrighterOfTwoLamps) {
  Image map = map_of(128, {0.1f, 0.1f, 0.1f});
  const Vec3d bright{0.5, 0.3, 0.8}, other{-0.5, 0.3, 0.8};
  paint_disk(&map, other, 2.0 * kDegree, {300, 300, 300});
  paint_disk(&map, bright, 2.0 * kDegree, {301, 301, 301});
  Environment rest = environment_of(map);
  const SunExtraction sun = extract_sun(rest, {});
  expect_whole(map, rest, sun);
  EXPECT_LT(angle(sun.disk.direction, normalize(bright)), 0.05 * kDegree);
  EXPECT_NEAR(rest.max_luminance, 300, 1e-3);
}

TEST(Sun, LeavesMapsWithoutOneAlone) {
  expect_untouched(map_of(8, {0, 0, 0}));
  expect_untouched(map_of(8, {3, 2, 1}));
  expect_untouched(Image(1, 1, 3));
  expect_untouched(sky_of(64));
  expect_untouched(reference::test_sky(4, 1e5));  // a texel of 45 degrees
  Image window = map_of(128, {0.1f, 0.1f, 0.1f});
  for (int y = 40; y < 70; ++y) {
    for (int x = 30; x < 60; ++x) {
      const Vec3 pane = Vec3{25, 25, 28} * (1 + 0.2f * std::sin(float(x * y)));
      std::copy_n(&pane.x, 3, window.at(x, y));
    }
  }
  expect_untouched(window);
  Image tube = map_of(512, {0.1f, 0.1f, 0.1f});
  for (int x = 300; x < 313; ++x) std::fill_n(tube.at(x, 255), 3, 400.0f);
  expect_untouched(tube);
  Image disk = map_of(256, {1, 1, 1});
  paint_disk(&disk, {1, 0.2, 0.1}, 2.0 * kDegree, {100, 100, 100});
  expect_untouched(disk, {.max_angular_radius_rad = 1.0 * kDegree});
  expect_untouched(disk, {.min_contrast = 60});
  Environment rest = environment_of(disk);
  EXPECT_TRUE(extract_sun(rest, {}).found);
}

// E2
TEST(Sun, KeepsTheEnergyOfEveryMapOfTheDataSet) {
  LIGHTKILN_NEEDS_DATA(data);
  const auto folder = data / "environments";
  int found = 0, refused = 0;
  for (const char* kind : {"latlong_hdr", "latlong_exr", "furnace"}) {
    for (const auto& entry : std::filesystem::directory_iterator(folder / kind)) {
      const Environment whole = make_environment(decode_hdr_image(test::read_file(entry.path())));
      Environment rest = whole;
      const SunExtraction sun = extract_sun(rest, {});
      const std::string name = entry.path().filename();
      SCOPED_TRACE(name);
      const bool sunny = name.starts_with("klopp") || name.starts_with("spiaggia") ||
                         name.ends_with("city.exr") || name.ends_with("sky.exr");
      const bool windows = name.starts_with("aero") || name.starts_with("studio") ||
                           name.ends_with("studio.exr") || name.ends_with("apartment.exr") ||
                           name.starts_with("white");
      if (sun.found) {
        expect_whole(whole.radiance, rest, sun);
        ++found;
        EXPECT_FALSE(windows) << sun.reason;
      } else {
        EXPECT_EQ(rest.radiance.pixels, whole.radiance.pixels);
        ++refused;
        EXPECT_FALSE(sunny) << sun.reason;
      }
      if (!sunny) continue;
      EXPECT_LT(sun.disk.angular_radius_rad, 0.7 * kDegree);
      EXPECT_LT(rest.max_luminance, 1e-2 * whole.max_luminance);
    }
  }
  EXPECT_EQ(found, 8);
  EXPECT_EQ(refused, 5);
}

// The usual cure clamps instead, and most of the light is gone: the control of the tests above.
TEST(Sun, WouldBeLostByClamping) {
  LIGHTKILN_NEEDS_DATA(data);
  Environment map = make_environment(
      decode_hdr_image(test::read_file(data / "environments/latlong_hdr/kloppenheim_05_1k.hdr")));
  const Vec3d whole = energy_of(map.radiance);
  for (float& v : map.radiance.pixels) v = std::min(v, 100.0f);
  EXPECT_LT(energy_of(map.radiance).y, 0.4 * whole.y);
}

// The lobes of a disk's harmonics against Gauss' rule over its cone, seen along its axis.
TEST(Sun, HasTheHarmonicsOfItsCap) {
  const Vec3d axis = normalize(Vec3d{0.3, -0.5, 0.4});
  const int bands = 129;
  std::vector<double> basis(sh_coefficient_count(bands)), tilted(basis.size());
  sh_evaluate_basis(axis, bands, basis);
  const GaussRule rule = gauss_legendre(64);
  for (const double radius : {1e-6, 0.2666 * kDegree, 2.5 * kDegree, 20 * kDegree}) {
    const SunDisk disk{axis, radius, {1, 2, 4}};
    const ShRgb sh = sun_harmonics(disk, bands);
    const Vec3d side = make_basis(axis).tangent;
    std::vector<double> expected(static_cast<size_t>(bands));
    for (size_t i = 0; i < rule.nodes.size(); ++i) {
      const double t = radius * (rule.nodes[i] + 1) / 2;
      sh_evaluate_basis(axis * std::cos(t) + side * std::sin(t), bands, tilted);
      for (int l = 0; l < bands; ++l) {
        double zonal = 0;  // sum_m y_lm(axis) y_lm(t) = (2l+1)/4pi P_l(cos t)
        for (int m = -l; m <= l; ++m) zonal += basis[sh_index(l, m)] * tilted[sh_index(l, m)];
        expected[static_cast<size_t>(l)] +=
            rule.weights[i] * radius / 2 * 2 * kPi * std::sin(t) * zonal;
      }
    }
    for (int l = 0; l < bands; ++l) {
      double along = 0;
      for (int m = -l; m <= l; ++m)
        along += sh.coefficients[sh_index(l, m)].y * basis[sh_index(l, m)];
      const double scale = cap_solid_angle(radius) * (2 * l + 1) / (4 * kPi);
      EXPECT_NEAR(along, 2 * expected[static_cast<size_t>(l)], 1e-10 * scale) << radius << " " << l;
    }
    const Vec3d facing = disk.irradiance();
    EXPECT_NEAR(facing.z, 4 * kPi * std::pow(std::sin(radius), 2), 1e-12 * facing.z);
    EXPECT_NEAR(disk.energy().x, 2 * std::sqrt(kPi) * sh.coefficients[0].x,
                1e-12 * disk.energy().x);
  }
}

// Coefficients are linear in radiance, so that those of the map are those of the rest and of the
// disk. The disk has the source's energy and direction; what it changes is how the source's light
// lies about its centre, which band l weighs by l (l+1) / 4 of its mean squared angle.
TEST(Sun, AddsUpToTheWholeInHarmonics) {
  LIGHTKILN_NEEDS_DATA(data);
  for (const char* name : {"kloppenheim_05_1k.hdr", "spiaggia_di_mondello_1k.hdr"}) {
    const Environment whole = make_environment(
        decode_hdr_image(test::read_file(data / "environments/latlong_hdr" / name)));
    Environment rest = whole;
    const SunExtraction sun = extract_sun(rest, {});
    ASSERT_TRUE(sun.found);
    Progress progress;
    const int bands = 9;
    const auto project = [&](const Environment& e) {
      return world_harmonics(project_for(e, {}, bands, 1, progress), bands);
    };
    const ShRgb a = project(whole), b = project(rest), c = sun_harmonics(sun.disk, bands);
    const Vec3d energy = sun.disk.energy();
    double without = 0;
    for (int l = 0; l < bands; ++l) {
      const double spread = l * (l + 1) / 4.0 * std::pow(1.0 * kDegree, 2);
      const double share = std::sqrt((2 * l + 1) / (4 * kPi)) * spread;
      for (int m = -l; m <= l; ++m) {
        const size_t i = sh_index(l, m);
        for (int k = 0; k < 3; ++k) {
          const double gap = a.coefficients[i][k] - b.coefficients[i][k];
          EXPECT_NEAR(gap, c.coefficients[i][k], share * energy[k] + 1e-6 * a.coefficients[0][k])
              << name << " " << l << " " << m;
          without = std::max(without, std::abs(gap));
        }
      }
    }
    EXPECT_GT(without, 0.3);
  }
}

}  // namespace
}  // namespace lightkiln

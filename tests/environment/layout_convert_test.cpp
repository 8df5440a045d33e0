// Tags beside tests are explained in tests/support/hard_cases.h.

#include "core/environment/layout_convert.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/environment/layout_sample.h"
#include "core/environment/polygon_coverage.h"
#include "core/environment/round_trip.h"
#include "core/image/exr.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/harmonic_rotation.h"
#include "core/sphere/harmonic_transform.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

// Smooth, and alike under no mirror or turn.
Vec3d light(const Vec3d& d) {
  return {2 + 0.5 * d.x + 0.3 * d.y * d.z, 2 + 0.6 * d.y - 0.2 * d.x * d.z,
          2 + 0.4 * d.z + 0.4 * d.x * d.y};
}

template <typename Function>
Image paint(const MapLayout& layout, Function function) {
  Image image(layout.width, layout.height, 3);
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      const auto d = layout_direction(layout, x + 0.5, y + 0.5);
      const Vec3 value = d ? to_float(function(*d)) : Vec3{};
      std::copy_n(&value.x, 3, image.at(x, y));
    }
  }
  return image;
}

MapLayout with_borders(MapLayout layout) {
  layout.convention = TexelConvention::openexr;
  return layout;
}

// About as many texels whatever the kind.
std::vector<MapLayout> targets(int size) {
  std::vector<MapLayout> layouts;
  for (int kind = 0; kind < 12; ++kind) {
    const LayoutKind k = static_cast<LayoutKind>(kind);
    MapLayout layout = make_layout(k, size);
    if (layout.width > layout.height && !is_cube(k)) layout = make_layout(k, 2 * size);
    if (is_cube(k)) layout = make_layout(k, size / 2);
    layouts.push_back(layout);
    if (k == LayoutKind::latlong || k == LayoutKind::cube_strip) {
      layouts.push_back(with_borders(layout));
    }
    if (k == LayoutKind::mirror_ball) {
      layouts.push_back(layout);
      layouts.back().camera_distance = 2.5;
    }
  }
  return layouts;
}

Image convert(const MapLayout& from, const Image& source, const MapLayout& to,
              MapFilter filter = MapFilter::adaptive, const Rotation& rotation = {}) {
  Progress progress;
  return convert_layout(from, source, to, rotation, filter, 2, progress);
}

double integral(const MapLayout& layout, const Image& image, int channel = 1) {
  double sum = 0;
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      sum += texel_solid_angle(layout, x, y) * double(image.at(x, y)[channel]);
    }
  }
  return sum;
}

TEST(PolygonCoverage, SharesOutTheAreaOfPolygons) {
  PolygonCoverage coverage;
  const GridPoint square[] = {{1.25, 2.5}, {3.75, 2.5}, {3.75, 4}, {1.25, 4}};
  coverage.cover(square, 4);
  EXPECT_NEAR(coverage.area(1, 2), 0.375, 1e-15);
  EXPECT_NEAR(coverage.area(2, 2), 0.5, 1e-15);
  EXPECT_NEAR(coverage.area(3, 3), 0.75, 1e-15);
  // Triangles against a count of points, in both orientations and outside the first quadrant.
  const GridPoint triangle[] = {{-2.3, -1.1}, {3.1, 0.4}, {-0.2, 2.9}};
  const GridPoint reversed[] = {triangle[2], triangle[1], triangle[0]};
  PolygonCoverage other;
  coverage.cover(triangle, 3);
  other.cover(reversed, 3);
  double sum = 0;
  for (int y = coverage.top(); y <= coverage.bottom(); ++y) {
    for (int x = coverage.left(); x <= coverage.right(); ++x) {
      int inside = 0;
      for (int k = 0; k < 100 * 100; ++k) {
        const double px = x + (k % 100 + 0.5) / 100, py = y + (k / 100 + 0.5) / 100;
        bool in = true;
        for (int e = 0; e < 3; ++e) {
          const GridPoint &a = triangle[e], &b = triangle[(e + 1) % 3];
          in = in && (b.x - a.x) * (py - a.y) - (b.y - a.y) * (px - a.x) > 0;
        }
        inside += in ? 1 : 0;
      }
      EXPECT_NEAR(coverage.area(x, y), inside / 1e4, 0.02);
      EXPECT_NEAR(coverage.area(x, y), other.area(x, y), 1e-14);
      sum += coverage.area(x, y);
    }
  }
  EXPECT_NEAR(sum, 0.5 * std::abs(5.4 * 4.0 - 1.5 * 2.1), 1e-13);
}

TEST(ConvertLayout, LeavesAConstantMapConstant) {
  for (const MapLayout& from : targets(16)) {
    const Image white = paint(from, [](const Vec3d&) { return Vec3d{0.7, 1, 3}; });
    if (covered_solid_angle(from) < 4 * kPi - 1e-9) continue;
    for (const MapLayout& to : targets(12)) {
      for (const MapFilter filter : {MapFilter::area, MapFilter::adaptive}) {
        const Image image = convert(from, white, to, filter, quaternion_rotation(0.1, 0.2, 0.3, 1));
        for (int y = 0; y < to.height; ++y) {
          for (int x = 0; x < to.width; ++x) {
            if (!texel_has_direction(to, x, y)) continue;
            ASSERT_EQ(image.rgb(x, y), (Vec3{0.7f, 1, 3}))
                << layout_name(from.kind) << " to " << layout_name(to.kind);
          }
        }
      }
    }
  }
}

// Away from horizons, caps and rims, where a texel shows more or less than its centre.
bool well_shown(const MapLayout& layout, const Vec3d& d) {
  if (layout.kind == LayoutKind::cylinder) return std::abs(d.y) < 0.75;
  if (layout.kind == LayoutKind::cylinder_equal_area) return std::abs(d.y) < 0.9;
  if (layout.kind == LayoutKind::angular) return d.z > -0.97;
  if (layout.kind == LayoutKind::mirror_ball) return d.z > -0.2;
  return covered_solid_angle(layout) > 4 * kPi - 1e-9 || d.y > 0.35;
}

// The value at a texel's centre, from every layout to every layout, turned as well. Mirroring,
// shifting by half a texel or tearing at a seam would show ten times larger.
TEST(ConvertLayout, ShowsTheSameLightInEveryLayout) {
  const Rotation turns[] = {Rotation{}, yaw_rotation(37), quaternion_rotation(0.3, -0.5, 0.2, 0.7)};
  size_t pair = 0;
  for (const MapLayout& from : targets(48)) {
    const Image source = paint(from, light);
    for (const MapLayout& to : targets(24)) {
      if (++pair % 2 == 0) continue;  // of odd rows the one half, of even rows the other
      const Rotation& turn = turns[pair % 3];
      const Image image = convert(from, source, to, MapFilter::adaptive, turn);
      double worst = 0;
      for (int y = 0; y < to.height; ++y) {
        for (int x = 0; x < to.width; ++x) {
          const auto d = layout_direction(to, x + 0.5, y + 0.5);
          if (!d || !well_shown(from, turn.undo(*d)) || !well_shown(to, *d)) continue;
          worst = std::max(worst, length(to_double(image.rgb(x, y)) - light(turn.undo(*d))));
        }
      }
      EXPECT_LT(worst, 0.03) << layout_name(from.kind) << " to " << layout_name(to.kind) << " "
                             << to.camera_distance;
    }
  }
}

// Energy, texel by texel of the source: a lamp of one texel, anywhere, keeps its light when the map
// shrinks. Sampling at texel centres would keep all or nothing of it.
TEST(ConvertLayout, KeepsTheEnergyOfEveryTexelWhenShrinking) {
  for (const MapLayout& from : targets(64)) {
    if (covered_solid_angle(from) < 4 * kPi - 1e-9) continue;
    // A border texel lit on one face only is no picture of anything.
    if (from.convention == TexelConvention::openexr) continue;
    for (const MapLayout& to : targets(12)) {
      if (covered_solid_angle(to) < 4 * kPi - 1e-9) continue;
      double worst = 0, sum_before = 0, sum_after = 0;
      for (int k = 0; k < 5; ++k) {
        const double z = 1 - 1.5 * (k + 0.37) / 5, a = 2.4 * k;
        const double across = std::sqrt(1 - z * z);
        const Vec3d lamp{across * std::cos(a), z, across * std::sin(a)};
        if (lamp.z < -0.75) continue;  // the stretched rims of balls
        const MapPlace place = layout_place(from, lamp).value();
        Image source(from.width, from.height, 3);
        source.at(static_cast<int>(place.x), static_cast<int>(place.y))[1] = 1000;
        const double before = integral(from, source);
        const double after = integral(to, convert(from, source, to, MapFilter::area));
        worst = std::max(worst, std::abs(after / before - 1));
        sum_before += before;
        sum_after += after;
      }
      EXPECT_LT(worst, 0.05) << layout_name(from.kind) << " to " << layout_name(to.kind);
      EXPECT_NEAR(sum_after / sum_before, 1, 0.01)
          << layout_name(from.kind) << " to " << layout_name(to.kind);
    }
  }
}

// The slow twin: 96 x 96 points a texel, each weighted by its solid angle.
TEST(ConvertLayout, AgreesWithASumOfPoints) {
  const MapLayout from = make_layout(LayoutKind::latlong, 128);
  Image source(from.width, from.height, 3);
  for (size_t i = 0; i < source.pixels.size(); ++i) {
    source.pixels[i] = static_cast<float>(i * 2654435761u % 1000) / 500;
  }
  for (const MapLayout& to : targets(12)) {
    const Image image = convert(from, source, to, MapFilter::area);
    double sum = 0;
    int count = 0;
    for (int y = 1; y < to.height; y += 3) {
      for (int x = 0; x < to.width; x += 2) {
        if (!texel_has_direction(to, x, y)) continue;
        if (to.convention == TexelConvention::openexr) {
          const int rows = is_cube(to.kind) ? to.width : to.height;
          if (x == 0 || x == to.width - 1 || y % rows == 0 || y % rows == rows - 1) continue;
        }
        Vec3d energy;
        double omega = 0;
        for (int k = 0; k < 96 * 96; ++k) {
          const double px = x + (k % 96 + 0.5) / 96, py = y + (k / 96 + 0.5) / 96;
          const auto d = layout_direction(to, px, py);
          if (!d) continue;
          const double weight = solid_angle_density(to, px, py);
          energy += nearest_radiance(from, source, layout_place(from, *d).value()) * weight;
          omega += weight;
        }
        const Vec3d error = to_double(image.rgb(x, y)) - energy / omega;
        sum += dot(error, error) / 3;
        ++count;
      }
    }
    EXPECT_GT(count, 10);
    EXPECT_LT(std::sqrt(sum / count), 4e-3) << layout_name(to.kind);
  }
}

TEST(ConvertLayout, NeitherRingsNorGoesNegativeWhenEnlarging) {
  for (const MapLayout& from : targets(12)) {
    Image source = paint(from, [](const Vec3d& d) {
      return d.x > 0.3 ? Vec3d{1e5, 1, 3} : Vec3d{0, 1, 2};
    });
    for (const MapLayout& to : targets(40)) {
      const Image image = convert(from, source, to);
      const bool whole = covered_solid_angle(from) > 4 * kPi - 1e-9;
      for (int y = 0; y < to.height; ++y) {
        for (int x = 0; x < to.width; ++x) {
          if (!texel_has_direction(to, x, y)) continue;
          const Vec3 v = image.rgb(x, y);
          ASSERT_TRUE(v.x >= 0 && v.x <= 1e5f && v.z <= 3);
          if (whole) {
            ASSERT_TRUE(v.y == 1 && v.z >= 2)
                << layout_name(from.kind) << " to " << layout_name(to.kind);
          }
        }
      }
    }
  }
}

// M5: neighbours across a seam differ no more than neighbours inside, also where a coarse
// map is enlarged: read along a circle that crosses seams, corners and poles.
TEST(ConvertLayout, IsContinuousAcrossSeamsWhenEnlarged) {
  for (const MapLayout& from : targets(12)) {
    if (covered_solid_angle(from) < 4 * kPi - 1e-9) continue;
    const Image source = paint(from, [](const Vec3d& d) {
      return Vec3d{1 + std::sin(9 * d.x), 1 + std::sin(11 * d.y), 1 + std::sin(10 * d.z)};
    });
    for (const Vec3d& axis :
         {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}, Vec3d{1, -1, 0}, Vec3d{0.3, 0.2, -0.5}}) {
      const Basis<double> basis = make_basis(normalize(axis));
      Vec3d last;
      double worst = 0, scale = 0;
      for (int i = 0; i <= 36000; ++i) {
        const double a = i * kPi / 18000;
        const Vec3d d = basis.tangent * std::cos(a) + basis.bitangent * std::sin(a);
        const Vec3d value = smooth_radiance(from, source, layout_place(from, d).value());
        if (i > 0) worst = std::max(worst, length(value - last));
        scale = std::max(scale, length(value));
        last = value;
      }
      // A step of 0.01 degrees against texels of 7 to 15 degrees.
      EXPECT_LT(worst, 0.02 * scale) << layout_name(from.kind) << " " << int(from.convention);
    }
  }
  // Positive control: read within its own face alone, a cube jumps at the edge.
  const MapLayout strip = make_layout(LayoutKind::cube_strip, 12);
  const Image source = paint(strip, [](const Vec3d& d) {
    return Vec3d{1 + std::sin(9 * d.x), 1, 1};
  });
  const auto in_own_face = [&](const Vec3d& d) {
    const MapPlace place = layout_place(strip, d).value();
    const int x = std::clamp(static_cast<int>(place.x), 0, 11);
    return source.rgb(x, std::clamp(static_cast<int>(place.y), 0, 71)).x;
  };
  const float before = in_own_face(normalize(Vec3d{1 + 1e-6, 0.02, 1}));
  const float after = in_own_face(normalize(Vec3d{1 - 1e-6, 0.02, 1}));
  EXPECT_GT(std::abs(before - after), 0.1);
}

TEST(ConvertLayout, MovesTexelsBetweenCubeLayouts) {
  const MapLayout strip = make_layout(LayoutKind::cube_strip, 12);
  const MapLayout wide = make_layout(LayoutKind::horizontal_cross, 12);
  const MapLayout high = make_layout(LayoutKind::vertical_cross, 12);
  Image source(strip.width, strip.height, 3);
  for (size_t i = 0; i < source.pixels.size(); ++i) source.pixels[i] = float(i) + 0.1f;
  const Image cross = convert(strip, source, wide), tall = convert(wide, cross, high);
  EXPECT_EQ(convert(high, tall, strip).pixels, source.pixels);
  EXPECT_EQ(convert(strip, source, high).pixels, tall.pixels);
  EXPECT_TRUE(moves_texels(wide, high, Rotation{}));
  EXPECT_FALSE(moves_texels(wide, high, yaw_rotation(90)));
  // A texel of each face against its direction.
  for (int face = 0; face < 6; ++face) {
    const MapPlace place = layout_place(wide, cube_texel_direction(face, 3, 7, 12)).value();
    EXPECT_EQ(cross.rgb(int(place.x), int(place.y)), source.rgb(3, face * 12 + 7));
  }
}

// All texels that repeat a direction hold the same bits.
TEST(ConvertLayout, RepeatsBorderTexelsExactly) {
  const MapLayout from = make_layout(LayoutKind::angular, 64);
  const Image source = paint(from, [](const Vec3d& d) { return light(d) * std::exp(5 * d.x); });
  const MapLayout map = with_borders(make_layout(LayoutKind::latlong, 48));
  const Image image = convert(from, source, map);
  for (int y = 0; y < 24; ++y) EXPECT_EQ(image.rgb(0, y), image.rgb(47, y));
  for (int x = 0; x < 48; ++x) {
    EXPECT_EQ(image.rgb(x, 0), image.rgb(0, 0));
    EXPECT_EQ(image.rgb(x, 23), image.rgb(0, 23));
  }
  const MapLayout strip = with_borders(make_layout(LayoutKind::cube_strip, 16));
  const Image cube = convert(from, source, strip);
  int pairs = 0;
  for (int a = 0; a < 96 * 16; ++a) {
    for (int b = a + 1; b < 96 * 16; ++b) {
      const Vec3d p = layout_direction(strip, a % 16 + 0.5, a / 16 + 0.5).value();
      const Vec3d q = layout_direction(strip, b % 16 + 0.5, b / 16 + 0.5).value();
      if (length(p - q) > 1e-9) continue;
      EXPECT_EQ(cube.rgb(a % 16, a / 16), cube.rgb(b % 16, b / 16));
      ++pairs;
    }
  }
  EXPECT_EQ(pairs, 12 * 14 + 8 * 3);
}

TEST(ConvertLayout, GivesTheSameBitsOnAnyNumberOfThreads) {
  const MapLayout from = make_layout(LayoutKind::latlong, 128);
  const Image source = paint(from, light);
  for (const MapLayout& to : targets(32)) {
    Progress progress;
    const Rotation turn = yaw_rotation(11);
    EXPECT_EQ(convert_layout(from, source, to, turn, MapFilter::adaptive, 1, progress).pixels,
              convert_layout(from, source, to, turn, MapFilter::adaptive, 3, progress).pixels);
  }
}

// Turning the map and turning its coefficients are the same turn.
TEST(ConvertLayout, TurnsAsHarmonicsTurn) {
  const MapLayout map = make_layout(LayoutKind::latlong, 256);
  const Image source = paint(map, [](const Vec3d& d) { return light(d) * std::exp(2 * d.x); });
  const Rotation turn = quaternion_rotation(0.4, -0.2, 0.6, 0.5);
  Progress progress;
  const auto project = [&](const Image& image) {
    return world_harmonics(project_latlong(image, 5, 2, 1, progress), 5);
  };
  const ShRgb turned = project(convert(map, source, map, MapFilter::adaptive, turn));
  const ShRgb exact = sh_rotate(project(source), turn.rows);
  const ShRgb still = project(source);
  double worst = 0, unturned = 0;
  for (size_t i = 0; i < exact.coefficients.size(); ++i) {
    worst = std::max(worst, length(turned.coefficients[i] - exact.coefficients[i]));
    unturned = std::max(unturned, length(still.coefficients[i] - exact.coefficients[i]));
  }
  EXPECT_LT(worst, 1e-3 * length(exact.coefficients[0]));
  EXPECT_GT(unturned, 0.1 * length(exact.coefficients[0]));
}

TEST(ConvertLayout, RefusesImagesThatAreNotTheirLayout) {
  Progress progress;
  const MapLayout map = make_layout(LayoutKind::latlong, 16), ball{LayoutKind::mirror_ball, 8, 9};
  const auto attempt = [&](const Image& image, const MapLayout& to) {
    convert_layout(map, image, to, Rotation{}, MapFilter::area, 1, progress);
  };
  EXPECT_THROW(attempt(Image(16, 9, 3), map), Error);
  EXPECT_THROW(attempt(Image(16, 8, 1), map), Error);
  EXPECT_THROW(attempt(Image(16, 8, 3), ball), Error);
}

// A texel of a small target shows much of the source: planning must not cost what baking does many
// times over.
TEST(ConvertLayout, EstimatesSmallTargetsFromFewTexels) {
  const MapLayout map = make_layout(LayoutKind::latlong, 64);
  const Image image = paint(map, light);
  const ConversionSource source(map, image);
  const auto looked_at = [&](LayoutKind kind, int size) {
    return estimate_conversion(source, make_layout(kind, size), yaw_rotation(10),
                               MapFilter::adaptive, 1e-3)
        .looked_at;
  };
  EXPECT_EQ(looked_at(LayoutKind::latlong, 2), 2);
  EXPECT_EQ(looked_at(LayoutKind::octahedral, 2), 4);
  EXPECT_EQ(looked_at(LayoutKind::octahedral, 8), 16);
  EXPECT_EQ(looked_at(LayoutKind::octahedral, 64), 1024);
  EXPECT_EQ(looked_at(LayoutKind::octahedral, 128), 1024);
  EXPECT_EQ(looked_at(LayoutKind::horizontal_cross, 1), 6);
}

TEST(RoundTrip, TellsWhatIsLost) {
  const MapLayout map = make_layout(LayoutKind::latlong, 256);
  const Image source = paint(map, [](const Vec3d& d) {
    return light(d) + Vec3d{1, 1, 1} * std::sin(20 * d.x + 13 * d.y);
  });
  Progress progress;
  const auto trip = [&](const MapLayout& to, const Rotation& turn = {}) {
    const Image image = convert(map, source, to, MapFilter::adaptive, turn);
    return measure_round_trip(map, source, to, image, turn, 1, progress);
  };
  const RoundTrip same = trip(map);
  EXPECT_EQ(same.relative_rms, 0);
  EXPECT_FALSE(same.psnr_db);
  double before = 1;
  for (const int size : {16, 32, 64, 128, 256}) {
    const RoundTrip octahedral =
        trip(make_layout(LayoutKind::octahedral, size), quaternion_rotation(1, 2, 3, 4));
    EXPECT_LT(octahedral.relative_rms, 0.6 * before) << size;
    EXPECT_NEAR(octahedral.mean_after / octahedral.mean_before, 1, 1e-3);
    EXPECT_EQ(octahedral.not_covered_share, 0);
    before = octahedral.relative_rms;
  }
  EXPECT_LT(before, 0.01);
  EXPECT_NEAR(trip(make_layout(LayoutKind::hemisphere, 64)).not_covered_share, 0.5, 1e-12);
  EXPECT_NEAR(trip(make_layout(LayoutKind::cylinder, 64)).not_covered_share,
              1 - std::sin(std::atan(kPi / 2)), 1e-12);
  // A close-up ball shows a great part of the sphere in its outermost texels.
  for (const double distance : {1.5, 10.0}) {
    MapLayout ball = make_layout(LayoutKind::mirror_ball, 128);
    ball.camera_distance = distance;
    const RoundTrip near = trip(ball);
    EXPECT_NEAR(near.mean_after / near.mean_before, 1, 3e-3) << distance;
  }
  // A wrong turn is a great loss: the figure can tell.
  const MapLayout square = make_layout(LayoutKind::octahedral, 256);
  const Image image = convert(map, source, square, MapFilter::adaptive, yaw_rotation(10));
  EXPECT_GT(measure_round_trip(map, source, square, image, Rotation{}, 1, progress).relative_rms,
            0.2);
}

}  // namespace
}  // namespace lightkiln

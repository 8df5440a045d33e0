// Tags beside tests are explained in tests/support/hard_cases.h.

#include "core/sphere/map_layout.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "core/sphere/cube_cross.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/radial_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {
namespace {

// Every kind, both conventions where they exist, and the parameters.
std::vector<MapLayout> all_layouts(int size) {
  std::vector<MapLayout> layouts;
  for (int kind = 0; kind < 12; ++kind) {
    const MapLayout layout = make_layout(static_cast<LayoutKind>(kind), size);
    layouts.push_back(layout);
    if (layout.kind == LayoutKind::latlong || layout.kind == LayoutKind::cube_strip) {
      layouts.push_back(layout);
      layouts.back().convention = TexelConvention::openexr;
    }
    if (layout.kind == LayoutKind::angular || layout.kind == LayoutKind::mirror_ball) {
      layouts.push_back(layout);
      layouts.back().mirrored = true;
    }
    if (layout.kind == LayoutKind::mirror_ball) {
      for (const double distance : {1.1, 3.0, 40.0}) {
        layouts.push_back(layout);
        layouts.back().camera_distance = distance;
      }
    }
  }
  return layouts;
}

Vec3d direction_of(double z, double azimuth) {
  const double across = std::sqrt(std::max(0.0, (1 - z) * (1 + z)));
  return {across * std::cos(azimuth), across * std::sin(azimuth), z};
}

// What a direction keeps of its digits on its way through a layout: all but the last few, except at
// the rim of a ball and the lower pole of the equal-area cylinder, where the image stands still
// while the angle moves: there a rounding e of the radius is an angle of 2 sqrt(2 e), 4.2e-8 for the
// last digit of 1 and 6e-8 for two of them.
double direction_tolerance(const MapLayout& layout, const Vec3d& d) {
  if (layout.kind == LayoutKind::cylinder_equal_area && d.y < 0) {
    return 1e-12 + 4e-16 / std::max(std::hypot(d.x, d.z), 1e-8);
  }
  if (layout.kind != LayoutKind::mirror_ball) return 1e-12;
  const double limit = radial_limit(layout);
  const double rest = std::abs(limit - std::atan2(std::hypot(d.x, d.y), d.z)) / 2;
  return 1e-12 + 4e-15 / std::max(rest, 6e-8);
}

void expect_round_trip(const MapLayout& layout, const Vec3d& d) {
  const std::optional<MapPlace> place = layout_place(layout, d);
  if (!place) {
    EXPECT_LT(covered_solid_angle(layout), 4 * kPi - 1e-9) << layout_name(layout.kind);
    return;
  }
  EXPECT_TRUE(place->x >= 0 && place->x <= layout.width);
  EXPECT_TRUE(place->y >= 0 && place->y <= layout.height);
  const std::optional<Vec3d> back = layout_direction(layout, place->x, place->y);
  ASSERT_TRUE(back) << layout_name(layout.kind);
  EXPECT_LT(length(*back - d), direction_tolerance(layout, d))
      << layout_name(layout.kind) << " " << d.x << " " << d.y << " " << d.z;
  EXPECT_NEAR(length(*back), 1, 1e-14);
}

RC_GTEST_PROP(MapLayout, BringsEveryDirectionBack, ()) {
  const double z = *rc::gen::inRange(-1000000, 1000001) * 1e-6;
  const double azimuth = *rc::gen::inRange(0, 1000000) * 1e-6 * 2 * kPi;
  // Uniform, or close to one of the places where layouts are cut: axes, diagonals, circles.
  Vec3d d = direction_of(z, azimuth);
  const int near = *rc::gen::inRange(0, 4);
  if (near > 0) {
    Vec3d centre(*rc::gen::inRange(-1, 2), *rc::gen::inRange(-1, 2), *rc::gen::inRange(-1, 2));
    centre = length(centre) > 0 ? normalize(centre) : Vec3d{0, 0, -1};
    const double offset = std::pow(10.0, -4.0 * near);
    d = normalize(centre + d * offset);
  }
  for (const MapLayout& layout : all_layouts(64)) expect_round_trip(layout, d);
}

TEST(MapLayout, BringsAxesEdgesAndCornersBack) {
  for (const MapLayout& layout : all_layouts(64)) {
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (x != 0 || y != 0 || z != 0) {
            expect_round_trip(layout, normalize(Vec3d(x, y, z)));
            expect_round_trip(
                layout, normalize(Vec3d(x == 0 ? -0.0 : x, y == 0 ? -0.0 : y, z == 0 ? -0.0 : z)));
          }
        }
      }
    }
  }
}

// M4: the rim is the direction behind the ball.
TEST(MapLayout, ShowsWhatIsBehindTheBallAllAlongItsRim) {
  const MapLayout ball = make_layout(LayoutKind::mirror_ball, 512);
  for (int i = 0; i < 360; ++i) {
    const double a = i * kPi / 180;
    const auto d = layout_direction(ball, 256 + 256 * std::cos(a), 256 + 256 * std::sin(a));
    ASSERT_TRUE(d);
    EXPECT_LT(length(*d - Vec3d{0, 0, -1}), 1e-6);
  }
}

TEST(MapLayout, SumsToTheSphereItCovers) {
  for (const int size : {2, 6, 7, 32, 96}) {
    for (const MapLayout& layout : all_layouts(size)) {
      if (layout_fault(layout) != nullptr) continue;
      double sum = 0;
      for (int y = 0; y < layout.height; ++y) {
        for (int x = 0; x < layout.width; ++x) sum += texel_solid_angle(layout, x, y);
      }
      EXPECT_NEAR(sum, covered_solid_angle(layout), 1e-11)
          << layout_name(layout.kind) << " " << size << " " << layout.camera_distance;
    }
  }
}

TEST(MapLayout, AgreesWithItsOwnDensity) {
  for (const MapLayout& layout : all_layouts(128)) {
    int checked = 0;
    for (int y = 1; y < layout.height - 1; y += 5) {
      for (int x = 1; x < layout.width - 1; x += 3) {
        // Inside a face and a disc.
        bool inside = true;
        for (const double dx : {-2.0, 3.0}) {
          for (const double dy : {-2.0, 3.0}) {
            inside = inside && layout_direction(layout, x + dx, y + dy).has_value();
          }
        }
        const double exact = texel_solid_angle(layout, x, y);
        const double density = solid_angle_density(layout, x + 0.5, y + 0.5);
        const bool border =
            is_cube(layout.kind) && (x % 128 == 0 || x % 128 == 127 || y % 128 == 0 ||
                                     y % 128 == 127);  // half a texel, by openexr
        if (!inside || exact == 0 || border) continue;
        // Two vectors along the texel: a third way, by differences of directions.
        const auto at = [&](double dx, double dy) {
          return layout_direction(layout, x + 0.5 + dx, y + 0.5 + dy).value();
        };
        const double h = 1e-4;
        const double area = length(cross(at(h, 0) - at(-h, 0), at(0, h) - at(0, -h))) / (4 * h * h);
        const bool kink = layout.kind == LayoutKind::octahedral ||
                          layout.kind == LayoutKind::equal_area_octahedral;
        if (!kink) {
          EXPECT_NEAR(area / density, 1, 1e-4) << layout_name(layout.kind);
        }
        EXPECT_NEAR(exact / density, 1, 0.15) << layout_name(layout.kind) << " " << x << " " << y;
        ++checked;
      }
    }
    EXPECT_GT(checked, 200) << layout_name(layout.kind);
  }
}

// The measures of M4 and their neighbours.
TEST(MapLayout, HasTheDensitiesOfTheBooks) {
  const MapLayout ball = make_layout(LayoutKind::mirror_ball, 64);
  const MapLayout angular = make_layout(LayoutKind::angular, 64);
  const MapLayout dome = make_layout(LayoutKind::hemisphere_equal_area, 64);
  const MapLayout square = make_layout(LayoutKind::equal_area_octahedral, 64);
  const double texel = 4.0 / (64 * 64);  // of the disc's plane
  for (int x = 10; x < 54; ++x) {
    const double r = std::hypot(2 * (x + 0.5) / 64 - 1, 2 * 30.5 / 64 - 1);
    EXPECT_NEAR(texel_solid_angle(ball, x, 30), 4 * texel, 1e-14);
    EXPECT_NEAR(texel_solid_angle(dome, x, 30), 2 * texel, 1e-14);
    EXPECT_NEAR(
        texel_solid_angle(angular, x, 30) / (kPi * kPi * std::sin(kPi * r) / (kPi * r) * texel), 1,
        3e-3);
    EXPECT_EQ(texel_solid_angle(square, x, 30), 4 * kPi / (64 * 64));
  }
  // A texel on the rim counts with its part: without, the sum is off by the rim.
  double whole = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) whole += texel_solid_angle(ball, x, y) > 0 ? 4 * texel : 0;
  }
  EXPECT_GT(whole / (4 * kPi) - 1, 0.01);
}

// A camera far away sees what the orthographic ball shows; close up, less of it.
TEST(MapLayout, BringsTheCameraCloseToTheBall) {
  MapLayout ball = make_layout(LayoutKind::mirror_ball, 64);
  const Vec3d d = normalize(Vec3d{0.3, -0.4, -0.2});
  const MapPlace far = layout_place(ball, d).value();
  ball.camera_distance = 1e5;
  const MapPlace nearly = layout_place(ball, d).value();
  EXPECT_NEAR(nearly.x, far.x, 1e-3);
  EXPECT_NEAR(nearly.y, far.y, 1e-3);
  ball.camera_distance = 2;  // the outline lies 30 degrees off the axis
  EXPECT_NEAR(covered_solid_angle(ball) / (4 * kPi), (1 + std::cos(kPi / 6)) / 2, 1e-12);
  EXPECT_FALSE(layout_covers(ball, {0, 0, -1}));
  EXPECT_TRUE(layout_covers(ball, direction_of(-0.8, 1)));
  // The law of reflection at the place that was found.
  const MapPlace place = layout_place(ball, d).value();
  const Vec3d camera{0, 0, 2};
  const double tan_beta = std::tan(kPi / 6);
  const Vec3d ray =
      normalize(Vec3d{-(2 * place.x / 64 - 1) * tan_beta, (1 - 2 * place.y / 64) * tan_beta, -1});
  const double along = dot(camera, ray);
  const Vec3d hit = camera - ray * (along + std::sqrt(along * along - 3));
  EXPECT_NEAR(length(hit), 1, 1e-12);
  EXPECT_LT(length(ray - hit * (2 * dot(ray, hit)) - d), 1e-12);
}

// Where each layout puts the axes: the one contract of orientation.
TEST(MapLayout, FacesForwardUprightAndUnmirrored) {
  const auto at = [](LayoutKind kind, int size, const Vec3d& d) {
    const MapLayout layout = make_layout(kind, size);
    const MapPlace place = layout_place(layout, d).value();
    return std::array<double, 2>{place.x / layout.width, place.y / layout.height};
  };
  using Pair = std::array<double, 2>;
  const auto expect = [](const Pair& a, const Pair& b) {
    EXPECT_NEAR(a[0], b[0], 1e-12);
    EXPECT_NEAR(a[1], b[1], 1e-12);
  };
  const Vec3d left{1, 0, 0}, right{-1, 0, 0}, up{0, 1, 0}, front{0, 0, 1}, back{0, 0, -1};
  for (const LayoutKind kind : {LayoutKind::angular, LayoutKind::mirror_ball}) {
    const double side = kind == LayoutKind::angular ? 0.25 : 0.5 * std::sin(kPi / 4);
    expect(at(kind, 64, front), {0.5, 0.5});
    expect(at(kind, 64, right), {0.5 + side, 0.5});
    expect(at(kind, 64, up), {0.5, 0.5 - side});
  }
  expect(at(LayoutKind::horizontal_cross, 64, left), {0.125, 0.5});
  expect(at(LayoutKind::horizontal_cross, 64, front), {0.375, 0.5});
  expect(at(LayoutKind::horizontal_cross, 64, right), {0.625, 0.5});
  expect(at(LayoutKind::horizontal_cross, 64, back), {0.875, 0.5});
  expect(at(LayoutKind::horizontal_cross, 64, up), {0.375, 1.0 / 6});
  expect(at(LayoutKind::vertical_cross, 64, back), {0.5, 0.875});
  expect(at(LayoutKind::vertical_cross, 64, -up), {0.5, 0.625});
  expect(at(LayoutKind::hemisphere, 64, up), {0.5, 0.5});
  expect(at(LayoutKind::hemisphere, 64, front), {0.5, 1});
  expect(at(LayoutKind::hemisphere_equal_area, 64, right), {1, 0.5});
  expect(at(LayoutKind::cylinder, 64, right), {0.75, 0.5});
  expect(at(LayoutKind::octahedral, 64, front), {0.5, 0.5});
  expect(at(LayoutKind::octahedral, 64, left), {1, 0.5});
  expect(at(LayoutKind::equal_area_octahedral, 64, up), {0.5, 1});
  EXPECT_FALSE(layout_covers(make_layout(LayoutKind::hemisphere, 64), -up));
  EXPECT_FALSE(layout_covers(make_layout(LayoutKind::cylinder, 64), up));
  // Unmirrored: going right and then down turns clockwise as seen from inside, in all of them.
  for (const MapLayout& layout : all_layouts(64)) {
    const double x = 0.46 * layout.width, y = (is_cube(layout.kind) ? 0.41 : 0.46) * layout.height;
    const Vec3d d = layout_direction(layout, x, y).value();
    const Vec3d dx = layout_direction(layout, x + 0.1, y).value() - d;
    const Vec3d dy = layout_direction(layout, x, y + 0.1).value() - d;
    EXPECT_EQ(dot(cross(dx, dy), d) > 0, !layout.mirrored) << layout_name(layout.kind);
  }
}

// Debevec's gallery: (u, v) = (Dx r, Dy r), r = acos(Dz) / (pi sqrt(Dx^2 + Dy^2)), v upwards.
TEST(MapLayout, SpeaksDebevecsFormulaWhenMirrored) {
  MapLayout layout = make_layout(LayoutKind::angular, 200);
  layout.mirrored = true;
  const Vec3d d = normalize(Vec3d{0.3, -0.5, -0.7});
  const double r = std::acos(d.z) / (kPi * std::hypot(d.x, d.y));
  const MapPlace place = layout_place(layout, d).value();
  EXPECT_NEAR(place.x, 100 * (1 + d.x * r), 1e-12);
  EXPECT_NEAR(place.y, 100 * (1 - d.y * r), 1e-12);
}

// Neighbours in the picture are neighbours on the cube: the texel that continues a face lies within
// two texels' angle, and going there and back is the same texel.
TEST(MapLayout, ContinuesAcrossEverySeam) {
  for (const MapLayout& layout : all_layouts(16)) {
    if (layout.convention == TexelConvention::openexr) continue;
    const int faces = is_cube(layout.kind) ? 6 : 1;
    for (int face = 0; face < faces; ++face) {
      const int size = is_cube(layout.kind) ? 16 : layout.width;
      const int rows = is_cube(layout.kind) ? 16 : layout.height;
      const FacePlace place = is_cube(layout.kind) ? face_place(layout.kind, face) : FacePlace{};
      for (int i = 0; i < size; ++i) {
        for (const auto& [x, y, dx, dy] : {std::array{i, 0, 0, -1},
                                           {i, rows - 1, 0, 1},
                                           {0, i % rows, -1, 0},
                                           {size - 1, i % rows, 1, 0}}) {
          const int px = place.column * 16 + x, py = place.row * 16 + y;
          const auto here = layout_direction(layout, px + 0.5, py + 0.5);
          int nx = px + dx, ny = py + dy;
          if (!here || !continue_texel(layout, face + 1, &nx, &ny)) continue;
          const auto there = layout_direction(layout, nx + 0.5, ny + 0.5);
          ASSERT_TRUE(there) << layout_name(layout.kind);
          // A step inside the image, for scale. Polar rows are half a turn apart in the image.
          const double step = std::sqrt(covered_solid_angle(layout) / (size * rows * faces));
          EXPECT_LT(length(*there - *here), 3.2 * step)
              << layout_name(layout.kind) << " " << px << " " << py << " " << nx << " " << ny;
        }
      }
    }
  }
}

TEST(MapLayout, NamesWhatIsWrongWithASize) {
  EXPECT_NE(layout_fault({.kind = LayoutKind::horizontal_cross, .width = 12, .height = 8}),
            nullptr);
  EXPECT_EQ(layout_fault({.kind = LayoutKind::horizontal_cross, .width = 12, .height = 9}),
            nullptr);
  EXPECT_NE(layout_fault({.kind = LayoutKind::angular, .width = 12, .height = 9}), nullptr);
  EXPECT_NE(layout_fault({.kind = LayoutKind::latlong, .width = 0, .height = 9}), nullptr);
  EXPECT_NE(layout_fault({.kind = LayoutKind::octahedral,
                          .width = 8,
                          .height = 8,
                          .convention = TexelConvention::openexr}),
            nullptr);
  EXPECT_NE(layout_fault(
                {.kind = LayoutKind::mirror_ball, .width = 8, .height = 8, .camera_distance = 0.5}),
            nullptr);
}

}  // namespace
}  // namespace lightkiln

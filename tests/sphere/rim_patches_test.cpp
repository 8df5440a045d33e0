#include "core/sphere/rim_patches.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/sphere/radial_map.h"

namespace lightkiln {
namespace {

std::vector<MapLayout> discs(int size) {
  std::vector<MapLayout> layouts;
  for (const LayoutKind kind : {LayoutKind::angular, LayoutKind::mirror_ball,
                                LayoutKind::hemisphere, LayoutKind::hemisphere_equal_area}) {
    layouts.push_back(make_layout(kind, size));
  }
  layouts.push_back(make_layout(LayoutKind::mirror_ball, size));
  layouts.back().camera_distance = 1.7;
  layouts.push_back(make_layout(LayoutKind::mirror_ball, size));
  layouts.back().mirrored = true;
  return layouts;
}

// Against the outline integral of texel_solid_angle(), which knows nothing of patches.
TEST(RimPatches, TileTheTexelsThatARimCuts) {
  for (const int size : {1, 2, 3, 5, 16, 37}) {
    for (const MapLayout& layout : discs(size)) {
      int cut = 0;
      for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) {
          const double whole = texel_solid_angle(layout, x, y);
          const std::vector<RimPatch> patches = rim_patches(layout, x, y);
          if (patches.empty()) continue;
          ++cut;
          double sum = 0;
          constexpr int kParts = 40;
          for (const RimPatch& patch : patches) {
            for (int i = 0; i < kParts; ++i) {
              sum += rim_solid_angle(layout, patch, 0, 0.3, i / double(kParts),
                                     (i + 1) / double(kParts)) +
                     rim_solid_angle(layout, patch, 0.3, 1, i / double(kParts),
                                     (i + 1) / double(kParts));
            }
          }
          // Next to the cell at a square root, which is exact, three points leave 1e-8.
          EXPECT_NEAR(sum, whole, 5e-8 * whole + 1e-13)
              << layout_name(layout.kind) << " " << size << ": " << x << "," << y;
        }
      }
      EXPECT_GE(cut, size == 1 ? 1 : 4);
    }
  }
}

TEST(RimPatches, LieInTheirTexelAndShowItsDirections) {
  for (const MapLayout& layout : discs(24)) {
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 24; ++x) {
        for (const RimPatch& patch : rim_patches(layout, x, y)) {
          for (const double a : {0.0, 0.2, 0.9, 1.0}) {
            for (const double b : {0.0, 0.4, 0.97}) {
              const RimPoint point = rim_point(layout, patch, a, b);
              EXPECT_TRUE(point.x > x - 1e-9 && point.x < x + 1 + 1e-9);
              EXPECT_TRUE(point.y > y - 1e-9 && point.y < y + 1 + 1e-9);
              const auto direction = layout_direction(layout, point.x, point.y);
              if (!direction) continue;  // a hair outside the rim
              EXPECT_LT(length(*direction - point.direction), 1e-6);
            }
          }
        }
      }
    }
  }
}

// d(omega) / (da db), against the solid angle of a small cell.
TEST(RimPatches, KnowTheirDensity) {
  for (const MapLayout& layout : discs(24)) {
    for (const RimPatch& patch : rim_patches(layout, 3, 4)) {
      const double side = 1e-3, a = 0.3, b = 0.6;
      const double omega =
          rim_solid_angle(layout, patch, a - side / 2, a + side / 2, b - side / 2, b + side / 2);
      EXPECT_NEAR(rim_density(layout, patch, b) * side * side / omega, 1, 1e-5);
    }
  }
}

TEST(RimPatches, AreNoneInsideTheDiscOrWithoutOne) {
  EXPECT_TRUE(rim_patches(make_layout(LayoutKind::angular, 64), 32, 20).empty());
  EXPECT_TRUE(rim_patches(make_layout(LayoutKind::latlong, 64), 0, 0).empty());
  EXPECT_TRUE(rim_patches(make_layout(LayoutKind::mirror_ball, 64), 0, 0).empty());
}

}  // namespace
}  // namespace lightkiln

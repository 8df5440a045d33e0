#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/sphere/direction_map.h"
#include "tests/support/probe_bake.h"

namespace lightkiln::test {
namespace {

TEST(Probes, InsideASolidIsTold) {
  SceneData data;
  data.parts.push_back({make_box({-1, -1, -1}, {1, 1, 1}), grey(0.5f), {}});
  ProbesOrder order;
  order.positions = {{0.2, 0.1, 0}, {3, 0.5, 0}};
  ProbesHandle state = open_probes(data, constant_environment({1, 1, 1}), order);
  const BakedProbes baked = bake_probes(state);
  EXPECT_EQ(baked.probes[0].surroundings.status, ProbeStatus::inside_geometry);
  EXPECT_EQ(baked.probes[0].surroundings.backface_share, 1.0);
  EXPECT_EQ(baked.probes[0].surroundings.hit_share, 1.0);
  EXPECT_EQ(baked.probes[1].surroundings.status, ProbeStatus::valid);
  EXPECT_EQ(baked.probes[1].surroundings.backface_share, 0.0);
  // A room seen from inside is no solid, nor is a double-sided box.
  data.parts[0].material.double_sided = true;
  state = open_probes(data, constant_environment({1, 1, 1}), order);
  EXPECT_EQ(bake_probes(state).probes[0].surroundings.status, ProbeStatus::valid);
}

TEST(Probes, OnAFaceEdgeOrCornerIsTold) {
  SceneData data;
  data.parts.push_back({make_box({-1, -1, -1}, {1, 1, 1}), grey(0.5f), {}});
  ProbesOrder order;
  order.size = 2;
  order.positions = {{1, 0.3, 0.2}, {1, 1, 0.2}, {1, 1, 1}, {1 + 1e-7, 0.3, 0.2}, {1.01, 0.3, 0.2}};
  ProbesHandle state = open_probes(data, constant_environment({1, 1, 1}), order);
  const BakedProbes baked = bake_probes(state);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NE(baked.probes[i].surroundings.status, ProbeStatus::valid) << i;
  }
  EXPECT_EQ(baked.probes[0].surroundings.status, ProbeStatus::on_surface);
  EXPECT_EQ(baked.probes[4].surroundings.status, ProbeStatus::valid);
}

// The distance cube of a room of 20 m a side, seen from its middle: each face's plane at 10 m.
TEST(Probes, DistancesAreWorldUnits) {
  SceneData data = room(0.5f, 1);
  data.parts[0].mesh = scaled(data.parts[0].mesh, 10);
  ProbesHandle state = open_probes(data, {}, {});
  const BakedProbes baked = bake_probes(state);
  for (int face = 0; face < 6; ++face) {
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        const Vec3d d = cube_texel_direction(face, x, y, 8);
        const double largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        const auto i = static_cast<size_t>((face * 8 + y) * 8 + x);
        EXPECT_NEAR(baked.probes[0].distance[i], 10 / largest, 1e-4);
      }
    }
  }
  EXPECT_NEAR(baked.probes[0].surroundings.distance_min, 10, 0.05);
  EXPECT_EQ(baked.probes[0].surroundings.hit_share, 1.0);
}

}  // namespace
}  // namespace lightkiln::test

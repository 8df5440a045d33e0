// The scenes that other tests trust.

#include <gtest/gtest.h>

#include "core/scene/normals.h"
#include "tests/support/gltf_builder.h"

using namespace lightkiln;
using namespace lightkiln::test;

// Signed volume by the divergence theorem: sum of a . (b x c) / 6, positive when faces look out.
static double signed_volume(const MeshData& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    sum += dot(to_double(mesh.positions[t[0]]),
               cross(to_double(mesh.positions[t[1]]), to_double(mesh.positions[t[2]])));
  }
  return sum / 6;
}

TEST(Builder, BoxAndSphereFaceOutwards) {
  EXPECT_NEAR(signed_volume(make_box({1, 2, 3}, {3, 5, 7})), 24, 1e-5);
  const double ball = 4 * kPi / 3 * 8;
  const double faceted = signed_volume(make_sphere({1, 1, 1}, 2, 64, 128));
  EXPECT_LT(faceted, ball);
  EXPECT_GT(faceted, ball * 0.995);
  EXPECT_NEAR(signed_volume(reversed(make_box({0, 0, 0}, {1, 1, 1}))), -1, 1e-6);
}

TEST(Builder, NormalsAgreeWithWinding) {
  for (const MeshData& mesh : {make_box({0, 0, 0}, {1, 2, 3}), make_floor(2), make_grid(1, 3),
                               make_sphere({0, 0, 0}, 1), reversed(make_sphere({0, 0, 0}, 1))}) {
    for (const auto& t : mesh.triangles) {
      const Vec3d area =
          doubled_area(to_double(mesh.positions[t[0]]), to_double(mesh.positions[t[1]]),
                       to_double(mesh.positions[t[2]]));
      for (uint32_t i : t) EXPECT_GT(dot(area, to_double(mesh.normals[i])), 0);
    }
  }
}

TEST(Normalisation, BringsTheLongestSideBetweenHalfAndOne) {
  for (double size : {1e-15, 0.1, 0.5, 1.0, 1.5, 1e5, 1e17}) {
    Bounds box;
    grow(box, {1, 2, 3});
    grow(box, {1 + size / 2, 2 + size, 3});
    const Normalisation n = make_normalisation(box);
    const double side = n.to_normalised(box.upper).y - n.to_normalised(box.lower).y;
    if (size > 1e-14) {
      EXPECT_GE(side, 0.5);
      EXPECT_LT(side, 1.0);
    }
    EXPECT_NEAR(n.to_world(n.to_normalised({1, 2, 3})).y, 2, (2 + size) * 1e-15);
  }
  EXPECT_EQ(make_normalisation({}).exponent, 0);
}

TEST(Normals, DoNotDependOnTheCutOfAFace) {
  const std::vector<Vec3> corner = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}};
  // The face z = 0 as one triangle at the corner, and as two; the other two faces as one each.
  const std::vector<std::array<uint32_t, 3>> one = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}};
  const std::vector<std::array<uint32_t, 3>> two = {{0, 2, 4}, {0, 4, 1}, {0, 1, 3}, {0, 3, 2}};
  const Vec3 a = mean_normals(corner, one)[0];
  const Vec3 b = mean_normals(corner, two)[0];
  EXPECT_NEAR(length(a - b), 0, 1e-6);
  EXPECT_NEAR(a.x, -1 / std::sqrt(3.f), 1e-6);
}

TEST(Normals, VertexWithoutTrianglesPointsUp) {
  const std::vector<Vec3> lonely = {{1, 2, 3}};
  EXPECT_EQ(mean_normals(lonely, {})[0], (Vec3{0, 1, 0}));
}

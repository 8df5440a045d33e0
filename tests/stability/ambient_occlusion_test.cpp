// What must not change an ambient-occlusion bake by a single byte, and shapes whose answer is
// exact.
// Tags beside tests are explained in tests/support/hard_cases.h.

#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "core/bake/vertex_facets.h"
#include "tests/support/ao_bake.h"

namespace lightkiln {
namespace {

using test::ao_order;
using test::ao_parameters;
using test::bake_ao;
using test::BakedAo;
using test::make_box;
using test::make_sphere;
using test::merged;
using test::MeshData;
using test::still_life;

TEST(AmbientOcclusionStability, ConvexSolidsAreExactlyOpenAtEveryScale) {  // A1, G3
  for (const float radius : {1e-6f, 1e-3f, 1.0f, 1e3f, 1e7f})
    for (const float centre : {0.0f, 1.0f, 1e5f}) {
      if (radius < 1e-5f * centre) continue;  // float cannot hold the shape
      const Vec3 c{centre, -centre, centre};
      const Vec3 r{radius, radius, radius};
      std::vector<MeshData> solids = {make_box(c - r, c + r)};
      if (radius >= 1e-3f * centre) solids.push_back(make_sphere(c, radius, 16, 32));
      for (const MeshData& solid : solids) {
        const BakedAo baked = bake_ao(solid, ao_order());
        ASSERT_EQ(baked.openness.size(), solid.positions.size());
        for (const float openness : baked.openness)
          ASSERT_EQ(openness, 1.0f) << "R " << radius << " at " << centre;
      }
    }
}

TEST(AmbientOcclusionStability, ClosedRoomsAreExactlyShut) {  // A1
  for (const float openness :
       bake_ao(test::reversed(make_box({-1, -1, -1}, {1, 1, 1})), ao_order()).openness)
    EXPECT_EQ(openness, 0.0f);
}

TEST(AmbientOcclusionStability, SmoothSpheresHaveNoDarkTerminator) {  // G10
  for (const float openness : bake_ao(make_sphere({0, 0, 0}, 1, 8, 16), ao_order()).openness)
    EXPECT_GE(openness, 0.9999f);
}

TEST(AmbientOcclusionStability, BytesDoNotDependOnThreadsOrChunks) {
  const MeshData mesh = still_life();
  const BakedAo one = bake_ao(mesh, ao_order(), 1, 1);
  ASSERT_GT(one.openness.size(), 400u);
  for (const int threads : {2, 8})
    EXPECT_EQ(bake_ao(mesh, ao_order(), threads, 1).bytes, one.bytes);
  for (const uint64_t chunks : {2u, 7u, 101u})
    EXPECT_EQ(bake_ao(mesh, ao_order(), 2, chunks).bytes, one.bytes) << chunks;
  const BakedAo again = bake_ao(mesh, ao_order(), 8, 7);
  ASSERT_EQ(again.assembly.artifacts.size(), one.assembly.artifacts.size());
  for (size_t i = 0; i < one.assembly.artifacts.size(); ++i)
    EXPECT_EQ(again.assembly.artifacts[i].bytes, one.assembly.artifacts[i].bytes)
        << one.assembly.artifacts[i].name;
  // Positive control: another seed is another bake.
  Spec reseeded = ao_order();
  reseeded.seed = 1;
  EXPECT_NE(bake_ao(mesh, reseeded).bytes, one.bytes);
}

TEST(AmbientOcclusionStability, ScaleChangesNoByte) {  // G4
  Spec spec = ao_order();
  ao_parameters(spec).falloff = Falloff::linear;
  ao_parameters(spec).max_distance = 1.5;
  const BakedAo plain = bake_ao(still_life(), spec);
  for (const int exponent : {-40, -20, 20, 40}) {
    Spec scaled = spec;
    ao_parameters(scaled).max_distance = std::ldexp(1.5, exponent);
    EXPECT_EQ(bake_ao(test::scaled(still_life(), std::ldexp(1.0f, exponent)), scaled).bytes,
              plain.bytes)
        << exponent;
  }
}

TEST(AmbientOcclusionStability, FarFromTheOriginDyadicShapesKeepTheirBytes) {  // G5
  MeshData mesh = still_life();
  for (Vec3& p : mesh.positions)
    for (int axis = 0; axis < 3; ++axis) p[axis] = std::round(p[axis] * 64) / 64;
  EXPECT_EQ(bake_ao(test::translated(mesh, {65536, -65536, 65536}), ao_order()).bytes,
            bake_ao(mesh, ao_order()).bytes);
}

TEST(AmbientOcclusionStability, WindingTurnedRoundChangesNoByte) {  // G9
  MeshData mesh = still_life();
  const BakedAo plain = bake_ao(mesh, ao_order());
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  EXPECT_EQ(bake_ao(mesh, ao_order()).bytes, plain.bytes);
  // Positive control: turning the normals round looks from the other side.
  EXPECT_NE(bake_ao(test::reversed(still_life()), ao_order()).bytes, plain.bytes);
}

TEST(AmbientOcclusionStability, MissingNormalsOfFlatMeshesChangeNothing) {  // G9
  const MeshData mesh = merged(test::make_grid(4, 12), make_box({1, 0, -1}, {2, 2, 1}));
  const BakedAo with = bake_ao(mesh, ao_order());
  const BakedAo without = bake_ao(test::without_normals(mesh), ao_order());
  for (size_t i = 0; i < with.openness.size(); ++i)
    EXPECT_NEAR(with.openness[i], without.openness[i], 1e-6f);
}

TEST(AmbientOcclusionStability, DoubledFacesChangeNoByte) {  // G13
  MeshData doubled = still_life();
  const auto once = doubled.triangles;
  doubled.triangles.insert(doubled.triangles.end(), once.begin(), once.end());
  const BakedAo single = bake_ao(still_life(), ao_order());
  EXPECT_EQ(bake_ao(doubled, ao_order()).bytes, single.bytes);
  // Only some of the faces, so that their vertices would weigh them twice.
  MeshData uneven = still_life();
  for (size_t i = 0; i < once.size(); i += 3) uneven.triangles.push_back(once[i]);
  EXPECT_EQ(bake_ao(uneven, ao_order()).bytes, single.bytes);
}

TEST(AmbientOcclusionStability, DoubledFacesWouldWeighTwiceUncleaned) {  // G13, positive control
  MeshData mesh = still_life();
  const auto once = mesh.triangles;
  const Scene single = test::scene_from_triangles(mesh);
  for (size_t i = 0; i < once.size(); i += 3) mesh.triangles.push_back(once[i]);
  const Scene uneven = test::scene_from_triangles(mesh);
  const VertexFacets one(single), two(uneven);
  int differ = 0;
  for (uint64_t v = 0; v < one.vertices(); ++v) {
    std::vector<Facet> a, b;
    one.facets(v, &a);
    two.facets(v, &b);
    differ += a.size() != b.size();
  }
  EXPECT_GT(differ, 100);
}

TEST(AmbientOcclusionStability, VerticesSplitAlongASeamGetOneValue) {
  // Every triangle with corners of its own, as if each were a texture island.
  const MeshData whole = merged(test::make_grid(4, 12), make_sphere({0, 1, 0}, 1, 12, 24));
  MeshData split;
  for (const auto& t : whole.triangles) {
    const auto first = static_cast<uint32_t>(split.positions.size());
    for (const uint32_t corner : t) {
      split.positions.push_back(whole.positions[corner]);
      split.normals.push_back(whole.normals[corner]);
      split.texcoords.push_back({static_cast<float>(first), 0});
    }
    split.triangles.push_back({first, first + 1, first + 2});
  }
  const BakedAo baked = bake_ao(split, ao_order());
  std::map<uint32_t, std::pair<float, float>> seen;
  size_t corner = 0;
  for (const auto& t : whole.triangles)
    for (const uint32_t vertex : t) {
      const std::pair value{baked.openness[corner], baked.errors[corner]};
      ++corner;
      EXPECT_EQ(seen.emplace(vertex, value).first->second, value);
    }
  EXPECT_EQ(seen.size(), whole.positions.size());
}

}  // namespace
}  // namespace lightkiln

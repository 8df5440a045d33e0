#include "core/bake/vertex_facets.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "core/base/random.h"
#include "core/scene/normals.h"

namespace lightkiln {

namespace {

// doubled_area() of a triangle, from the corner with the lowest index so that turning the winding
// round changes its sign and nothing else.
Vec3d area_by_index(const SurfaceMesh& mesh, std::array<uint32_t, 3> t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return doubled_area(to_double(mesh.positions[t[0]]), to_double(mesh.positions[t[1]]),
                      to_double(mesh.positions[t[2]]));
}

// What a ray's start may be off by, on each axis, before it must not see its own triangle: the
// start's own rounding and Embree's arithmetic on corners relative to it, both bounded by gamma(7)
// times the largest corner coordinate (see surface_point).
Vec3 corner_error(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  constexpr double kGamma7 = 7 * 0x1p-24 / (1 - 7 * 0x1p-24);
  Vec3 error;
  for (int axis = 0; axis < 3; ++axis)
    error[axis] = static_cast<float>(
        kGamma7 * std::max({std::fabs(a[axis]), std::fabs(b[axis]), std::fabs(c[axis])}));
  return error;
}

// How far inside: a thousandth of the way to the centroid. That shifts the openness beside a wall
// by about 1e-3 * (triangle size / 3) / (wall height), below every error that can be ordered
// sensibly. The share grows where a triangle is so small that a thousandth of it would not stand
// clear of the lift off the surface: with h the triangle's least height, the point at share f keeps
// at least f h / 3 from the edges at the vertex, and eight lifts are asked for. At most the
// centroid.
constexpr double kInset = 1e-3;
double inset_share(double lift, double least_height) {
  return std::clamp(8 * 3 * lift / least_height, kInset, 1.0);
}

}  // namespace

bool make_facet(const SurfaceMesh& mesh, const std::array<uint32_t, 3>& triangle, int corner,
                const Vec3& toward, Facet* facet) {
  const Vec3d area = area_by_index(mesh, triangle);
  const double size = length(area);
  if (!(size > 0)) return false;
  Vec3d normal = area / size;
  if (dot(normal, to_double(toward)) < 0) normal = -normal;

  const auto at = static_cast<size_t>(corner);
  const Vec3d p = to_double(mesh.positions[triangle[at]]);
  // The other two corners by index, so that both windings compute alike.
  uint32_t one = triangle[(at + 1) % 3];
  uint32_t two = triangle[(at + 2) % 3];
  if (one > two) std::swap(one, two);
  const Vec3d q = to_double(mesh.positions[one]);
  const Vec3d r = to_double(mesh.positions[two]);
  const Vec3d pq = q - p;
  const Vec3d pr = r - p;
  const double longest = std::max({length(pq), length(pr), length(r - q)});

  SurfacePoint point;
  // Adding zero turns -0 into +0, which a basis built from the normal would tell apart.
  point.normal = to_float(normal) + Vec3{0, 0, 0};
  point.error = corner_error(p, q, r);
  const Vec3d error = to_double(point.error);
  const double lift =
      std::fabs(normal.x) * error.x + std::fabs(normal.y) * error.y + std::fabs(normal.z) * error.z;
  const double share = inset_share(lift, size / longest);
  point.position = to_float(p + (pq + pr) * (share / 3));
  facet->origin = offset_origin(point, point.normal);
  facet->normal = point.normal;
  facet->weight = std::atan2(size, dot(pq, pr));  // the angle at p
  return facet->weight > 0;
}

namespace {

// Position and normal as bits, with -0 taken for +0.
using PlaceKey = std::array<uint32_t, 6>;
PlaceKey place_key(const SurfaceMesh& mesh, size_t vertex) {
  PlaceKey key;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<size_t>(axis);
    key[at] = std::bit_cast<uint32_t>(mesh.positions[vertex][axis] + 0.0f);
    key[at + 3] = std::bit_cast<uint32_t>(mesh.normals[vertex][axis] + 0.0f);
  }
  return key;
}

uint64_t hash_key(const PlaceKey& key) {
  uint64_t hash = 0;
  for (size_t i = 0; i < 6; i += 2) hash = hash_combine(hash, uint64_t{key[i]} << 32 | key[i + 1]);
  return hash;
}

// For every vertex of the scene the first one with the same key: an open-addressing table at most
// half full.
std::vector<uint64_t> find_representatives(const Scene& scene, uint64_t vertices) {
  constexpr uint64_t kEmpty = ~uint64_t{0};
  std::vector<uint64_t> table(std::bit_ceil(2 * vertices + 1), kEmpty);
  const uint64_t mask = table.size() - 1;
  std::vector<PlaceKey> keys;
  keys.reserve(vertices);
  std::vector<uint64_t> representatives;
  representatives.reserve(vertices);
  for (const SurfaceMesh& mesh : scene.meshes)
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
      const uint64_t index = keys.size();
      keys.push_back(place_key(mesh, v));
      uint64_t slot = hash_key(keys.back()) & mask;
      while (table[slot] != kEmpty && keys[table[slot]] != keys.back()) slot = (slot + 1) & mask;
      if (table[slot] == kEmpty) table[slot] = index;
      representatives.push_back(table[slot]);
    }
  return representatives;
}

}  // namespace

VertexFacets::VertexFacets(const Scene& scene) : scene_(&scene) {
  first_vertex_.push_back(0);
  first_triangle_.push_back(0);
  for (const SurfaceMesh& mesh : scene.meshes) {
    first_vertex_.push_back(first_vertex_.back() + mesh.positions.size());
    first_triangle_.push_back(first_triangle_.back() + mesh.triangles.size());
  }
  representative_ = find_representatives(scene, vertices());
  begin_.assign(vertices() + 1, 0);
  const auto each_corner = [&](const auto& body) {
    for (size_t m = 0; m < scene.meshes.size(); ++m) {
      const auto& triangles = scene.meshes[m].triangles;
      for (size_t t = 0; t < triangles.size(); ++t)
        for (size_t c = 0; c < 3; ++c)
          body(representative_[first_vertex_[m] + triangles[t][c]],
               3 * (first_triangle_[m] + t) + c);
    }
  };
  each_corner([&](uint64_t vertex, uint64_t) { ++begin_[vertex + 1]; });
  for (const uint64_t vertex : representative_) unused_ += begin_[vertex + 1] == 0;
  for (size_t v = 0; v + 1 < begin_.size(); ++v) begin_[v + 1] += begin_[v];
  corners_.resize(begin_.back());
  std::vector<uint64_t> next(begin_.begin(), begin_.end() - 1);
  each_corner([&](uint64_t vertex, uint64_t corner) { corners_[next[vertex]++] = corner; });
}

size_t VertexFacets::mesh_of(uint64_t index, const std::vector<uint64_t>& first) const {
  return static_cast<size_t>(std::upper_bound(first.begin(), first.end(), index) - first.begin()) -
         1;
}

void VertexFacets::facets(uint64_t vertex, std::vector<Facet>* out) const {
  const uint64_t v = representative_[vertex];
  const size_t home = mesh_of(v, first_vertex_);
  const Vec3& toward = scene_->meshes[home].normals[v - first_vertex_[home]];
  for (uint64_t i = begin_[v]; i < begin_[v + 1]; ++i) {
    const uint64_t triangle = corners_[i] / 3;
    const size_t m = mesh_of(triangle, first_triangle_);
    const SurfaceMesh& mesh = scene_->meshes[m];
    Facet facet;
    if (make_facet(mesh, mesh.triangles[triangle - first_triangle_[m]],
                   static_cast<int>(corners_[i] % 3), toward, &facet))
      out->push_back(facet);
  }
}

}  // namespace lightkiln

#pragma once

// One scene as every bake sees it: triangles in world orientation, recentred and scaled into a box
// of extent about one, with materials, textures and lights. Instances are flattened: one
// SurfaceMesh for each glTF primitive under each node that shows it.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

// normalised = (world - centre) * 2^exponent. The scaling is exact; the subtraction is made in
// double.
struct Normalisation {
  Vec3d centre;
  int exponent = 0;

  double scale() const { return std::ldexp(1.0, exponent); }
  Vec3d to_normalised(const Vec3d& world) const { return (world - centre) * scale(); }
  Vec3d to_world(const Vec3d& normalised) const {
    return normalised * std::ldexp(1.0, -exponent) + centre;
  }
};

struct Bounds {
  Vec3d lower{INFINITY, INFINITY, INFINITY};
  Vec3d upper{-INFINITY, -INFINITY, -INFINITY};

  bool empty() const { return !(lower.x <= upper.x); }
  Vec3d extent() const { return empty() ? Vec3d{} : upper - lower; }
};

// Enlarges `bounds` to hold the point.
void grow(Bounds& bounds, const Vec3d& point);

// Centre: the middle of the box. Exponent: the one that brings the longest side of the box into
// [0.5, 1); 0 for a box without extent. The identity for an empty box.
Normalisation make_normalisation(const Bounds& world);

enum class WrapMode { repeat, mirrored_repeat, clamp };

struct Texture {
  std::string name;
  int width = 0;
  int height = 0;
  std::vector<uint8_t> rgba;  // as stored, [(y * width + x) * 4 + channel], top row first
  WrapMode wrap_s = WrapMode::repeat;
  WrapMode wrap_t = WrapMode::repeat;
  bool nearest = false;  // magnification filter; otherwise bilinear
};

// Where a material reads a texture; uv' = offset + R(rotation) * (scale * uv),
// KHR_texture_transform.
struct TextureSlot {
  int texture = -1;  // index into Scene::textures; -1 = none
  int texcoord = 0;  // 0 or 1
  Vec2 offset{0, 0};
  Vec2 scale{1, 1};
  float rotation_rad = 0;
};

enum class AlphaMode { opaque, mask, blend };

struct Material {
  std::string name;
  Vec3 base_color{1, 1, 1};  // linear factor
  float alpha = 1;
  TextureSlot base_color_texture;  // sRGB
  Vec3 emissive{0, 0, 0};        // linear radiance factor, KHR_materials_emissive_strength included
  TextureSlot emissive_texture;  // sRGB
  AlphaMode alpha_mode = AlphaMode::opaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
  bool unlit = false;  // KHR_materials_unlit: shows base colour, takes and gives no light
  float metallic = 1;  // factors only; probes treat every surface as diffuse and say so
  float roughness = 1;
  bool has_metallic_roughness_texture = false;
};

struct SurfaceMesh {
  std::string name;  // "node/mesh" as named by the file, or by index
  int node = -1;     // glTF indices, for the result's index and the written GLB
  int mesh = -1;
  int primitive = -1;
  int material =
      -1;  // index into Scene::materials; every mesh has one (the default one if need be)
  // Normalised space, in the file's order and number, also where no triangle uses them. One that
  // was dropped (not finite, oversize) stands at the origin.
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;  // unit, one a position; from the file or the mean geometric normal
  bool normals_from_file = false;
  std::vector<Vec2> texcoords[2];            // empty or one a position
  std::vector<std::array<float, 4>> colors;  // COLOR_0, linear RGBA, empty or one a position
  // Counter-clockwise seen from outside, also under mirroring nodes. Dropped triangles are absent.
  std::vector<std::array<uint32_t, 3>> triangles;
};

enum class LightKind { directional, point, spot };

struct PunctualLight {
  std::string name;
  LightKind kind = LightKind::point;
  Vec3 intensity;    // colour x intensity: candela (point, spot), lux (directional), as radiometric
  Vec3d position;    // world space
  Vec3d direction;   // unit, the way the light travels; world space
  double range = 0;  // world units; 0 = unlimited
  double inner_cone_rad = 0;
  double outer_cone_rad = 0.7853981633974483;
};

// What loading ignored, dropped or repaired, with counts; goes into the plan and the result.
struct SceneReport {
  uint64_t triangles = 0;  // kept
  uint64_t vertices = 0;   // of triangle primitives
  uint64_t dropped_nan_vertices = 0;
  uint64_t dropped_infinite_vertices = 0;
  uint64_t dropped_oversize_vertices = 0;
  uint64_t dropped_degenerate_triangles = 0;  // zero area
  uint64_t dropped_duplicate_triangles = 0;
  uint64_t dropped_broken_triangles = 0;  // touch a dropped vertex
  uint64_t repaired_normals = 0;          // zero, non-finite or not unit
  uint64_t meshes_without_normals = 0;
  uint64_t ignored_points_and_lines = 0;  // primitives
  uint64_t open_edges = 0;                // edges with one triangle after welding by position
  uint64_t inconsistent_edges = 0;        // edges whose two triangles wind the same way
  std::vector<std::string> warnings;      // sentences: ignored extensions, rest pose, ...
};

struct Scene {
  Normalisation normalisation;
  Bounds bounds;  // of the normalised positions that triangles use; empty() without triangles
  std::vector<SurfaceMesh> meshes;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<PunctualLight> lights;
  SceneReport report;
};

}  // namespace lightkiln

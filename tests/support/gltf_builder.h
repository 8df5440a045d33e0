#pragma once

// Small scenes made in code: as GLB bytes for everything that reads files, and as a Scene for
// everything that does not need to.

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace lightkiln::test {

// Counter-clockwise seen from outside. `normals`, `texcoords` and `colors` are empty or one a
// position.
struct MeshData {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec2> texcoords;
  std::vector<std::array<float, 4>> colors;
  std::vector<std::array<uint32_t, 3>> triangles;
};

// A parallelogram corner, corner + u, corner + u + v, corner + v; normal u x v; texcoords 0 to 1.
MeshData make_quad(const Vec3& corner, const Vec3& u, const Vec3& v);
// The square [-half, half]^2 in the plane y = height, seen from +Y.
MeshData make_floor(float half, float height = 0);
// Six quads with normals outwards; reversed() makes a room of it.
MeshData make_box(const Vec3& lower, const Vec3& upper);
// Latitude rings and longitude segments about +Y, closed, smooth normals; one vertex a pole.
MeshData make_sphere(const Vec3& centre, float radius, int rings = 16, int segments = 32);
// `divisions` squares a side of the square [-half, half]^2 in the plane y = height.
MeshData make_grid(float half, int divisions, float height = 0);

MeshData merged(const MeshData& a, const MeshData& b);
MeshData translated(MeshData mesh, const Vec3& offset);
MeshData scaled(MeshData mesh, float factor);
// Winding and normals turned round.
MeshData reversed(MeshData mesh);
MeshData without_normals(MeshData mesh);

struct Part {
  MeshData mesh;
  Material material;
  std::optional<std::array<double, 16>> matrix;  // of its node, column-major as in glTF
};

// Texture slots of materials index `textures` (for make_scene) and `images` (for make_glb).
struct SceneData {
  std::vector<Part> parts;
  std::vector<PunctualLight> lights;  // position and direction are kept (direction by rotation)
  std::vector<Texture> textures;
  std::vector<std::vector<std::byte>> images;  // encoded PNG or JPEG
};

// GLB bytes: one mesh and node a part, indexed triangles, 32-bit indices, float attributes.
std::vector<std::byte> make_glb(const MeshData& mesh, const Material& material = {});
std::vector<std::byte> make_glb(const SceneData& scene);
// The container alone, padded as the format asks. An empty `bin` leaves the chunk out.
std::vector<std::byte> make_glb_container(const std::string& json, std::span<const std::byte> bin);

// What load_gltf would give, without cleaning: triangles stay as they are, absent normals become
// mean geometric ones, and the normalisation is the loader's. Part matrices are applied; a
// mirroring one turns the winding.
Scene scene_from_triangles(const MeshData& mesh, const Material& material = {});
Scene make_scene(const SceneData& scene);

}  // namespace lightkiln::test

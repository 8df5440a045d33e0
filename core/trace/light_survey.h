#pragma once

// What light a scene and its environment hold, in figures: areas, albedos and upper bounds. The
// effects decide by them; nothing is traced.

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/environment/environment.h"
#include "core/scene/scene.h"

namespace lightkiln {

// The colours of one texture over all its texels; linear, [0, 1].
struct TextureRange {
  Vec3d mean;
  Vec3d max;
  bool white = true;  // every texel is (1, 1, 1): reading it changes nothing
};
TextureRange texture_range(const Texture& texture);

// One mesh's surface as light transport sees it.
struct MeshSurvey {
  double area = 0;              // normalised units squared, one side
  Vec3d max_albedo;             // each channel in [0, 1]
  Vec3d mean_albedo;            // factor times the means of texture and vertex colours
  Vec3d mean_emission;          // factor times the mean of the texture; 0 when it emits nothing
  Vec3d max_emission;           // the most that any texel emits
  Vec3d mean_shown;             // of an unlit mesh: what it shows, as mean_albedo; 0 otherwise
  bool textured = false;        // a base-colour texture that is not white, or a textured emission
  bool vertex_colored = false;  // a vertex colour that is not white
  bool alpha_tested = false;    // MASK with some texel, vertex or factor under the cutoff
  bool emits() const { return luminance(max_emission) > 0; }
};

struct LightSurvey {
  std::vector<MeshSurvey> meshes;  // as Scene::meshes
  double area = 0;                 // of all meshes
  double unlit_area = 0;
  double emissive_area = 0;
  double emissive_power = 0;  // area times luminance of emission, one side
  double metallic_area = 0;   // metallic factor above 0
  double blend_area = 0;      // alpha mode BLEND
  uint64_t triangles = 0;
  double max_albedo = 0;    // largest channel of any lit surface
  double mean_albedo = 0;   // luminance, weighted by area
  double max_emission = 0;  // luminance
  bool textured = false;
  bool vertex_colored = false;
  bool alpha_tested = false;

  bool environment = false;  // one that is not black
  bool environment_constant = false;
  double environment_max = 0;   // luminance
  double environment_mean = 0;  // luminance, over the sphere

  // By LightKind: lights that shine, and the most irradiance over pi that any surface can receive
  // from all of them (for point and spot lights by the distance to the nearest triangle).
  struct Punctual {
    uint64_t count = 0;
    double max_irradiance_over_pi = 0;
    double least_patch = INFINITY;  // least of `patches` of those lights
  };
  Punctual punctual[3];
  // As Scene::lights: about which share of all area a light shines on, by the solid angle of its
  // cone at the nearest surface (spots: along their axis). INFINITY for directional ones.
  std::vector<double> patches;
};

// Pure. `environment` may be null (black).
LightSurvey survey_light(const Scene& scene, const Environment* environment);

// Largest component.
inline double max_channel(const Vec3d& v) {
  return v.x > v.y ? (v.x > v.z ? v.x : v.z) : (v.y > v.z ? v.y : v.z);
}

}  // namespace lightkiln

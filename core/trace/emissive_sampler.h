#pragma once

// Draws points on emissive triangles in proportion to area times mean luminance of the mesh, so
// that the density per area is one constant for each mesh. Textured emission uses factor times the
// mean of the texture for the table and the true texel for the light.

#include <cstdint>
#include <vector>

#include "core/trace/light_survey.h"
#include "core/trace/tracer.h"

namespace lightkiln {

class EmissiveSampler {
 public:
  EmissiveSampler() = default;
  EmissiveSampler(const Scene& scene, const LightSurvey& survey);

  bool empty() const { return triangles_.empty(); }

  // A point, uniform on a triangle drawn by its share of the whole. choice, u, v in [0, 1).
  // The result's t is 0.
  Hit sample(float choice, float u, float v) const;

  // Density per normalised area of sample() on mesh `mesh`; 0 for one that emits nothing.
  float area_density(uint32_t mesh) const { return density_[mesh]; }

 private:
  struct Triangle {
    uint32_t mesh;
    uint32_t triangle;
  };
  std::vector<Triangle> triangles_;
  std::vector<double> cdf_;     // one more than triangles, from 0 to 1, strictly increasing
  std::vector<float> density_;  // by mesh
};

}  // namespace lightkiln

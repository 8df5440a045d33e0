#include "core/trace/emissive_sampler.h"

#include <algorithm>

#include "core/scene/normals.h"

namespace lightkiln {

// With weight w_i = A_i Y_m (area, mean luminance of its mesh) and W = sum w_i, triangle i is drawn
// with probability w_i / W and a point of it with density 1 / A_i, so the density per area is
// Y_m / W whichever triangle of mesh m it is.
EmissiveSampler::EmissiveSampler(const Scene& scene, const LightSurvey& survey)
    : density_(scene.meshes.size(), 0.0f) {
  cdf_.push_back(0);
  double total = 0;
  for (uint32_t m = 0; m < scene.meshes.size(); ++m) {
    const SurfaceMesh& mesh = scene.meshes[m];
    const double brightness = luminance(survey.meshes[m].mean_emission);
    if (!(brightness > 0)) continue;
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& corner = mesh.triangles[t];
      const double area = 0.5 * length(doubled_area(to_double(mesh.positions[corner[0]]),
                                                    to_double(mesh.positions[corner[1]]),
                                                    to_double(mesh.positions[corner[2]])));
      if (!(area > 0)) continue;
      total += area * brightness;
      triangles_.push_back({m, t});
      cdf_.push_back(total);
    }
  }
  if (triangles_.empty()) return;
  for (double& value : cdf_) value /= total;
  cdf_.back() = 1;
  for (uint32_t m = 0; m < scene.meshes.size(); ++m) {
    density_[m] = static_cast<float>(luminance(survey.meshes[m].mean_emission) / total);
  }
}

// Uniform on a triangle: with s = sqrt(u), the barycentrics (1 - s, s (1 - v), s v) have constant
// density (Turk, "Generating random points in triangles", Graphics Gems, 1990).
Hit EmissiveSampler::sample(float choice, float u, float v) const {
  const auto above =
      std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, static_cast<double>(choice));
  const auto index = static_cast<size_t>(above - cdf_.begin()) - 1;
  const float s = std::sqrt(u);
  Hit hit;
  hit.t = 0;
  hit.mesh = triangles_[index].mesh;
  hit.triangle = triangles_[index].triangle;
  hit.u = s * (1 - v);
  hit.v = s * v;
  return hit;
}

}  // namespace lightkiln

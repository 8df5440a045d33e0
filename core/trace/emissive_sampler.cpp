#include "core/trace/emissive_sampler.h"

#include <algorithm>
#include <cmath>

#include "core/scene/normals.h"
#include "core/trace/texture.h"

namespace lightkiln {

namespace {

double triangle_area(const SurfaceMesh& mesh, uint32_t triangle) {
  const auto& corner = mesh.triangles[triangle];
  return 0.5 * length(doubled_area(to_double(mesh.positions[corner[0]]),
                                   to_double(mesh.positions[corner[1]]),
                                   to_double(mesh.positions[corner[2]])));
}

}  // namespace

// A triangle weighs its area times the mean luminance of its mesh or, textured, of its own texels.
EmissiveSampler::Weights EmissiveSampler::weigh(const Scene& scene, const LightSurvey& survey,
                                                uint32_t number, Shining shining, Purpose purpose,
                                                bool textures) {
  const SurfaceMesh& mesh = scene.meshes[number];
  const MeshSurvey& facts = survey.meshes[number];
  const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
  const bool unlit = shining == Shining::unlit;
  Weights weights;
  if (unlit != material.unlit) return weights;
  weights.brightness = luminance(unlit ? facts.mean_shown : facts.mean_emission);
  if (!(weights.brightness > 0)) return weights;
  const TextureSlot& slot = unlit ? material.base_color_texture : material.emissive_texture;
  const bool textured = textures && facts.textured && slot.texture >= 0;
  const auto add = [&](double floor) {
    std::unique_ptr<TexturedEmission>& map = textured_[number];
    if (textured) {
      map = std::make_unique<TexturedEmission>(
          mesh, slot, scene.textures[static_cast<size_t>(slot.texture)],
          to_double(unlit ? material.base_color : material.emissive), floor);
    }
    weights.triangles.clear();
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      weights.triangles.push_back(triangle_area(mesh, t) *
                                  (map ? map->mean(t) : weights.brightness));
      weights.power += weights.triangles.back();
    }
  };
  if (textured && purpose == Purpose::seeing) add(kHotSpot * weights.brightness);
  if (!(weights.power > 0)) add(0);
  return weights;
}

// Triangle i of mesh m has weight w_i = A_i Y_i, mesh m W_m = sum w_i. With W = sum W_m and
// B = sum Y_m, mesh m gets the share P_m = W_m / W, or (W_m / W + Y_m / B) / 2; its triangle i is
// drawn with probability P_m w_i / W_m and an even point of it with density 1 / A_i, so the density
// per area is P_m Y_i / W_m, times that of the map against even points.
EmissiveSampler::EmissiveSampler(const Scene& scene, const LightSurvey& survey, Shining shining,
                                 Purpose purpose, bool textures)
    : density_(scene.meshes.size(), 0.0f),
      scale_(scene.meshes.size()),
      textured_(scene.meshes.size()) {
  std::vector<Weights> meshes;
  double power = 0, brightness = 0, total = 0;
  for (uint32_t m = 0; m < scene.meshes.size(); ++m) {
    meshes.push_back(weigh(scene, survey, m, shining, purpose, textures));
    if (!(meshes.back().power > 0)) continue;
    power += meshes.back().power;
    brightness += meshes.back().brightness;
  }
  cdf_.push_back(0);
  for (uint32_t m = 0; m < scene.meshes.size(); ++m) {
    const Weights& mesh = meshes[m];
    if (!(mesh.power > 0)) continue;
    const double by_power = mesh.power / power;
    const double share =
        purpose == Purpose::lighting ? by_power : 0.5 * (by_power + mesh.brightness / brightness);
    const double scale = share / mesh.power;
    density_[m] = static_cast<float>(scale * mesh.brightness);
    scale_[m] = scale;
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      if (!(mesh.triangles[t] > 0)) continue;
      total += scale * mesh.triangles[t];
      triangles_.push_back({m, t});
      cdf_.push_back(total);
    }
  }
  if (triangles_.empty()) return;
  cdf_.back() = std::max(1.0, total);
}

// Uniform on a triangle: with s = sqrt(u), the barycentrics (1 - s, s (1 - v), s v) have constant
// density (Turk, "Generating random points in triangles", Graphics Gems, 1990).
EmissiveSampler::Draw EmissiveSampler::sample(const Point4& u) const {
  const auto above = std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, static_cast<double>(u.x));
  const auto index = static_cast<size_t>(above - cdf_.begin()) - 1;
  Draw draw;
  Hit& hit = draw.point;
  hit.t = 0;
  hit.mesh = triangles_[index].mesh;
  hit.triangle = triangles_[index].triangle;
  if (const TexturedEmission* textured = textured_[hit.mesh].get()) {
    const TexturedEmission::Point point = textured->sample(hit.triangle, u.w, u.y, u.z);
    hit.u = point.u;
    hit.v = point.v;
    draw.area_density =
        static_cast<float>(scale_[hit.mesh] * textured->mean(hit.triangle) * point.density);
    return draw;
  }
  const float s = std::sqrt(u.y);
  hit.u = s * (1 - u.z);
  hit.v = s * u.z;
  draw.area_density = density_[hit.mesh];
  return draw;
}

float EmissiveSampler::area_density(const Hit& hit) const {
  const TexturedEmission* textured = textured_[hit.mesh].get();
  if (!textured) return density_[hit.mesh];
  return static_cast<float>(scale_[hit.mesh] * textured->mean(hit.triangle) *
                            textured->density(hit.triangle, hit.u, hit.v));
}

}  // namespace lightkiln

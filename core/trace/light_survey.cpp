#include "core/trace/light_survey.h"

#include <algorithm>
#include <array>

#include "core/base/pinned_math.h"
#include "core/image/ldr.h"
#include "core/scene/normals.h"
#include "core/trace/texture.h"

namespace lightkiln {

namespace {

std::array<double, 256> decode_table() {
  std::array<double, 256> table{};
  for (size_t i = 0; i < table.size(); ++i) {
    table[i] = static_cast<double>(srgb_to_linear(static_cast<uint8_t>(i)));
  }
  return table;
}

Vec3d clamp_unit(const Vec3d& v) {
  return {std::clamp(v.x, 0.0, 1.0), std::clamp(v.y, 0.0, 1.0), std::clamp(v.z, 0.0, 1.0)};
}

Vec3d component_max(const Vec3d& a, const Vec3d& b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

struct VertexColorRange {
  Vec3d mean{1, 1, 1};
  Vec3d max{1, 1, 1};
  bool white = true;
};

VertexColorRange vertex_color_range(const SurfaceMesh& mesh) {
  VertexColorRange range;
  if (mesh.colors.empty()) return range;
  range = {{}, {}, true};
  for (const std::array<float, 4>& color : mesh.colors) {
    const Vec3d rgb{color[0], color[1], color[2]};
    range.mean += rgb;
    range.max = component_max(range.max, rgb);
    range.white = range.white && rgb == Vec3d{1, 1, 1};
  }
  range.mean *= 1.0 / static_cast<double>(mesh.colors.size());
  return range;
}

double mesh_area(const SurfaceMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    sum += length(doubled_area(to_double(mesh.positions[t[0]]), to_double(mesh.positions[t[1]]),
                               to_double(mesh.positions[t[2]])));
  }
  return 0.5 * sum;
}

const TextureRange* slot_range(const TextureSlot& slot, const std::vector<TextureRange>& ranges) {
  return slot.texture < 0 ? nullptr : &ranges[static_cast<size_t>(slot.texture)];
}

MeshSurvey survey_mesh(const Scene& scene, const SurfaceMesh& mesh, const Material& material,
                       const std::vector<TextureRange>& ranges) {
  MeshSurvey survey;
  survey.area = mesh_area(mesh);
  const VertexColorRange colors = vertex_color_range(mesh);
  survey.vertex_colored = !colors.white;
  Vec3d factor = to_double(material.base_color);
  Vec3d largest = factor * colors.max;
  Vec3d mean = factor * colors.mean;
  if (const TextureRange* base = slot_range(material.base_color_texture, ranges)) {
    largest = largest * base->max;
    mean = mean * base->mean;
    survey.textured = !base->white;
  }
  survey.max_albedo = material.unlit ? Vec3d{} : clamp_unit(largest);
  survey.mean_albedo = material.unlit ? Vec3d{} : clamp_unit(mean);
  if (material.unlit) survey.mean_shown = clamp_unit(mean);
  survey.alpha_tested = needs_alpha_test(scene, mesh);
  if (!material.unlit) {
    survey.mean_emission = survey.max_emission = to_double(material.emissive);
    if (const TextureRange* emissive = slot_range(material.emissive_texture, ranges)) {
      survey.mean_emission = survey.mean_emission * emissive->mean;
      survey.max_emission = survey.max_emission * emissive->max;
      survey.textured = survey.textured || (survey.emits() && !emissive->white);
    }
  }
  return survey;
}

// The distance from p to the triangle (a, b, c): to its plane where the foot lies inside, else to
// the nearest edge. Double; degenerate edges count as points.
double segment_distance(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
  const Vec3d edge = b - a;
  const double size = dot(edge, edge);
  const double t = size > 0 ? std::clamp(dot(p - a, edge) / size, 0.0, 1.0) : 0.0;
  return length(p - (a + edge * t));
}
double triangle_distance(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d n = cross(b - a, c - a);
  const bool inside = dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 &&
                      dot(cross(a - c, p - c), n) >= 0;
  if (inside && dot(n, n) > 0) return std::abs(dot(p - a, n)) / length(n);
  return std::min(
      {segment_distance(p, a, b), segment_distance(p, b, c), segment_distance(p, c, a)});
}

// Triangles looked at for all lights together; past it a light is taken to touch a surface, which
// leaves its bound infinite instead of making the survey slow.
constexpr uint64_t kMostDistances = 50'000'000;

// In normalised units; infinite for a scene without triangles.
double nearest_surface(const Scene& scene, const Vec3d& point) {
  double nearest = INFINITY;
  for (const SurfaceMesh& mesh : scene.meshes) {
    for (const auto& t : mesh.triangles) {
      nearest = std::min(nearest, triangle_distance(point, to_double(mesh.positions[t[0]]),
                                                    to_double(mesh.positions[t[1]]),
                                                    to_double(mesh.positions[t[2]])));
    }
  }
  return nearest;
}

// The distance along a unit direction to the first triangle; infinite when none is met (Moeller and
// Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997).
double surface_along(const Scene& scene, const Vec3d& point, const Vec3d& direction) {
  double nearest = INFINITY;
  for (const SurfaceMesh& mesh : scene.meshes) {
    for (const auto& t : mesh.triangles) {
      const Vec3d a = to_double(mesh.positions[t[0]]);
      const Vec3d ab = to_double(mesh.positions[t[1]]) - a,
                  ac = to_double(mesh.positions[t[2]]) - a;
      const Vec3d p = cross(direction, ac), from = point - a;
      const double determinant = dot(ab, p);
      if (determinant == 0) continue;
      const double u = dot(from, p) / determinant;
      const Vec3d q = cross(from, ab);
      const double v = dot(direction, q) / determinant, distance = dot(ac, q) / determinant;
      if (u >= 0 && v >= 0 && u + v <= 1 && distance > 0) nearest = std::min(nearest, distance);
    }
  }
  return nearest;
}

// About what a point or a spot light shines on: the solid angle of its cone at the distance where
// that meets something.
double patch_area(const Scene& scene, const PunctualLight& light, const Vec3d& point,
                  double nearest) {
  if (light.kind == LightKind::point) return 4 * kPi * nearest * nearest;
  const double along = surface_along(scene, point, light.direction);
  const double distance = along < INFINITY ? along : nearest;
  return 2 * kPi * (1 - pinned_sin_cos(light.outer_cone_rad).cos) * distance * distance;
}

void survey_punctual(const Scene& scene, LightSurvey* survey) {
  uint64_t looked_at = 0;
  survey->patches.assign(scene.lights.size(), INFINITY);
  for (size_t i = 0; i < scene.lights.size(); ++i) {
    const PunctualLight& light = scene.lights[i];
    const double intensity = luminance(to_double(light.intensity));
    if (!(intensity > 0)) continue;
    LightSurvey::Punctual& kind = survey->punctual[static_cast<int>(light.kind)];
    ++kind.count;
    double irradiance = intensity;
    if (light.kind != LightKind::directional) {
      looked_at += survey->triangles;
      const bool afford = looked_at <= kMostDistances;
      const Vec3d point = scene.normalisation.to_normalised(light.position);
      const double nearest = afford ? nearest_surface(scene, point) : 0;
      const double distance = nearest / scene.normalisation.scale();
      irradiance = intensity / (distance * distance);
      survey->patches[i] = afford ? patch_area(scene, light, point, nearest) / survey->area : 0;
      kind.least_patch = std::min(kind.least_patch, survey->patches[i]);
    }
    kind.max_irradiance_over_pi += irradiance / kPi;
  }
}

}  // namespace

TextureRange texture_range(const Texture& texture) {
  static const std::array<double, 256> kDecode = decode_table();
  TextureRange range;
  range.white = true;
  const size_t texels = texture.rgba.size() / 4;
  for (size_t i = 0; i < texels; ++i) {
    const uint8_t* p = texture.rgba.data() + 4 * i;
    const Vec3d rgb{kDecode[p[0]], kDecode[p[1]], kDecode[p[2]]};
    range.mean += rgb;
    range.max = component_max(range.max, rgb);
    range.white = range.white && p[0] == 255 && p[1] == 255 && p[2] == 255;
  }
  if (texels > 0) range.mean *= 1.0 / static_cast<double>(texels);
  return range;
}

LightSurvey survey_light(const Scene& scene, const Environment* environment) {
  std::vector<TextureRange> ranges;
  for (const Texture& texture : scene.textures) ranges.push_back(texture_range(texture));

  LightSurvey survey;
  double albedo_area = 0;
  for (const SurfaceMesh& mesh : scene.meshes) {
    const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
    const MeshSurvey one = survey_mesh(scene, mesh, material, ranges);
    survey.meshes.push_back(one);
    survey.area += one.area;
    survey.triangles += mesh.triangles.size();
    if (mesh.triangles.empty()) continue;
    if (material.unlit) survey.unlit_area += one.area;
    if (one.emits()) survey.emissive_area += one.area;
    survey.emissive_power += one.area * luminance(one.mean_emission);
    if (material.metallic > 0 && !material.unlit) survey.metallic_area += one.area;
    if (material.alpha_mode == AlphaMode::blend) survey.blend_area += one.area;
    survey.max_albedo = std::max(survey.max_albedo, max_channel(one.max_albedo));
    albedo_area += luminance(one.mean_albedo) * one.area;
    survey.max_emission = std::max(survey.max_emission, luminance(one.max_emission));
    survey.textured = survey.textured || one.textured;
    survey.vertex_colored = survey.vertex_colored || one.vertex_colored;
    survey.alpha_tested = survey.alpha_tested || one.alpha_tested;
  }
  if (survey.area > 0) survey.mean_albedo = albedo_area / survey.area;
  if (environment != nullptr && environment->max_luminance > 0) {
    survey.environment = true;
    survey.environment_constant = environment->constant;
    survey.environment_max = environment->max_luminance;
    survey.environment_mean = luminance(environment->mean);
  }
  survey_punctual(scene, &survey);
  return survey;
}

}  // namespace lightkiln

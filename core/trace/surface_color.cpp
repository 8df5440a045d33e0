#include "core/trace/surface_color.h"

#include <algorithm>

#include "core/trace/texture.h"

namespace lightkiln {

namespace {

Vec3 clamp_unit(const Vec3& v) {
  return {std::clamp(v.x, 0.0f, 1.0f), std::clamp(v.y, 0.0f, 1.0f), std::clamp(v.z, 0.0f, 1.0f)};
}

const Texture* texture_of(const Scene& scene, const TextureSlot& slot) {
  return slot.texture < 0 ? nullptr : &scene.textures[static_cast<size_t>(slot.texture)];
}

Vec3 read(const Texture& texture, const TextureSlot& slot, const SurfaceMesh& mesh, const Hit& hit,
          RayCounters& counters) {
  ++counters.texture_reads;
  const Vec2 uv = interpolate_texcoord(mesh, slot.texcoord, hit.triangle, hit.u, hit.v);
  const Vec4 texel = sample_texture(texture, transform_texcoord(slot, uv));
  return {texel.x, texel.y, texel.z};
}

}  // namespace

SurfaceColors::SurfaceColors(const Scene& scene, const LightSurvey& survey,
                             const EffectSelection& selection)
    : scene_(&scene) {
  records_.reserve(scene.meshes.size());
  for (size_t i = 0; i < scene.meshes.size(); ++i) {
    const SurfaceMesh& mesh = scene.meshes[i];
    const Material& material = scene.materials[static_cast<size_t>(mesh.material)];
    const MeshSurvey& facts = survey.meshes[i];
    SurfaceRecord record;
    record.mesh = &mesh;
    record.material = &material;
    record.base_color = clamp_unit(material.base_color);
    if (selection.textures && facts.textured) {
      record.base_texture = texture_of(scene, material.base_color_texture);
    }
    record.vertex_colors = selection.vertex_colors && facts.vertex_colored;
    record.alpha_tested = selection.alpha_test && facts.alpha_tested;
    record.double_sided = material.double_sided;
    record.unlit = material.unlit;
    record.emits = selection.emissive && facts.emits();
    if (record.emits) {
      record.emission = material.emissive;
      if (selection.textures && facts.textured) {
        record.emissive_texture = texture_of(scene, material.emissive_texture);
      }
    }
    records_.push_back(record);
  }
}

Vec3 SurfaceColors::detailed_base_color(const SurfaceRecord& record, const Hit& hit,
                                        RayCounters& counters) const {
  Vec3 color = record.material->base_color;
  if (record.base_texture != nullptr) {
    color = color * read(*record.base_texture, record.material->base_color_texture, *record.mesh,
                         hit, counters);
  }
  if (record.vertex_colors) {
    const auto& corner = record.mesh->triangles[hit.triangle];
    const float weights[3] = {1 - hit.u - hit.v, hit.u, hit.v};
    Vec3 vertex_color;
    for (size_t i = 0; i < 3; ++i) {
      const std::array<float, 4>& rgba = record.mesh->colors[corner[i]];
      vertex_color += Vec3{rgba[0], rgba[1], rgba[2]} * weights[i];
    }
    color = color * vertex_color;
  }
  return clamp_unit(color);
}

Vec3 SurfaceColors::detailed_emission(const SurfaceRecord& record, const Hit& hit,
                                      RayCounters& counters) const {
  return record.emission * read(*record.emissive_texture, record.material->emissive_texture,
                                *record.mesh, hit, counters);
}

bool SurfaceColors::present(const Hit& hit, RayCounters& counters) const {
  const SurfaceRecord& record = records_[hit.mesh];
  if (!record.alpha_tested) return true;
  return surface_alpha(*scene_, *record.mesh, hit.triangle, hit.u, hit.v,
                       &counters.texture_reads) >= record.material->alpha_cutoff;
}

}  // namespace lightkiln

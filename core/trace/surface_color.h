#pragma once

// What a surface reflects and emits at a point, from factors, textures and vertex colours.

#include <vector>

#include "core/scene/scene.h"
#include "core/trace/effects.h"
#include "core/trace/tracer.h"

namespace lightkiln {

// One mesh, ready to shade. A flag is off where its effect is, so that nothing is read for it.
struct SurfaceRecord {
  const SurfaceMesh* mesh = nullptr;
  const Material* material = nullptr;
  Vec3 base_color;  // factor
  Vec3 emission;    // factor; 0 where emission is off
  const Texture* base_texture = nullptr;
  const Texture* emissive_texture = nullptr;
  bool vertex_colors = false;
  bool emits = false;
  bool alpha_tested = false;
  bool double_sided = false;
  bool unlit = false;
};

class SurfaceColors {
 public:
  SurfaceColors(const Scene& scene, const LightSurvey& survey, const EffectSelection& selection);

  const SurfaceRecord& record(uint32_t mesh) const { return records_[mesh]; }

  // Base colour in [0, 1]: the albedo of a lit surface, the radiance of an unlit one.
  template <bool kDetail>
  Vec3 base_color(const Hit& hit, RayCounters& counters) const {
    const SurfaceRecord& record = records_[hit.mesh];
    if constexpr (kDetail) {
      if (record.base_texture != nullptr || record.vertex_colors) {
        return detailed_base_color(record, hit, counters);
      }
    }
    return record.base_color;
  }

  // Radiance that leaves the front (and, when double-sided, the back).
  template <bool kDetail>
  Vec3 emission(const Hit& hit, RayCounters& counters) const {
    const SurfaceRecord& record = records_[hit.mesh];
    if constexpr (kDetail) {
      if (record.emissive_texture != nullptr) return detailed_emission(record, hit, counters);
    }
    return record.emission;
  }

  // False where a masked surface has a hole at the point.
  bool present(const Hit& hit, RayCounters& counters) const;

 private:
  const Scene* scene_;
  std::vector<SurfaceRecord> records_;

  Vec3 detailed_base_color(const SurfaceRecord& record, const Hit& hit,
                           RayCounters& counters) const;
  Vec3 detailed_emission(const SurfaceRecord& record, const Hit& hit, RayCounters& counters) const;
};

}  // namespace lightkiln

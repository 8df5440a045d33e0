// Apart from the tracer, so that a program that only adds counters up does not load Embree.

#include "core/trace/tracer.h"

namespace lightkiln {

RayCounters& RayCounters::operator+=(const RayCounters& other) {
  occlusion_rays += other.occlusion_rays;
  nearest_rays += other.nearest_rays;
  shadow_rays += other.shadow_rays;
  bounce_rays += other.bounce_rays;
  rejected_rays += other.rejected_rays;
  filter_calls += other.filter_calls;
  texture_reads += other.texture_reads;
  environment_reads += other.environment_reads;
  point_queries += other.point_queries;
  projected_texels += other.projected_texels;
  cube_texels += other.cube_texels;
  return *this;
}

}  // namespace lightkiln

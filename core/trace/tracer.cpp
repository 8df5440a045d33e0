#include "core/trace/tracer.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <string>

#include <embree3/rtcore.h>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/trace/texture.h"

namespace lightkiln {

namespace {

// Embree's build asserts on components above 1.844e18; the gate stays below with room to spare.
constexpr float kLargestComponent = 1e18f;

// The context of every call, carrying the caller's counters to the filters.
struct Context {
  RTCIntersectContext embree;
  RayCounters* counters;

  explicit Context(RayCounters& caller) : counters(&caller) { rtcInitIntersectContext(&embree); }
};

// What an alpha-tested geometry's filter needs.
struct MaskedMesh {
  const Scene* scene;
  const SurfaceMesh* mesh;
  float cutoff;
};

// Embree calls this for candidate hits of masked geometry. A hit whose alpha lies below the cutoff
// is struck out and the ray goes on.
void alpha_filter(const RTCFilterFunctionNArguments* args) {
  const auto& masked = *static_cast<const MaskedMesh*>(args->geometryUserPtr);
  RayCounters& counters = *reinterpret_cast<Context*>(args->context)->counters;
  for (unsigned int i = 0; i < args->N; ++i) {
    if (args->valid[i] != -1) continue;
    ++counters.filter_calls;
    const float alpha =
        surface_alpha(*masked.scene, *masked.mesh, RTCHitN_primID(args->hit, args->N, i),
                      RTCHitN_u(args->hit, args->N, i), RTCHitN_v(args->hit, args->N, i),
                      &counters.texture_reads);
    if (alpha < masked.cutoff) args->valid[i] = 0;
  }
}

// Bytes that the device holds, kept under a limit by refusing allocations.
struct MemoryBudget {
  std::atomic<int64_t> bytes{0};
  int64_t limit = 0;  // 0 = none
};

// Embree asks before an allocation (post = false; a refusal ends the build) and reports after a
// release (post = true), which must be counted whatever we answer.
bool watch_memory(void* budget_pointer, ssize_t bytes, bool post) {
  auto& budget = *static_cast<MemoryBudget*>(budget_pointer);
  const int64_t total = budget.bytes.fetch_add(bytes) + bytes;
  if (post || bytes <= 0 || budget.limit == 0 || total <= budget.limit) return true;
  budget.bytes.fetch_sub(bytes);
  return false;
}

const char* unpinned_isa() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512vl"))
    return "avx512";
  if (__builtin_cpu_supports("avx2")) return "avx2";
  if (__builtin_cpu_supports("avx")) return "avx";
  return __builtin_cpu_supports("sse4.2") ? "sse4.2" : "sse2";
}

// avx gives the bits of sse2 and sse4.2; from avx2 on, fused multiply-add changes them.
const char* pinned_isa() {
  if (__builtin_cpu_supports("avx")) return "avx";
  return __builtin_cpu_supports("sse4.2") ? "sse4.2" : "sse2";
}

}  // namespace

struct Tracer::Impl {
  const Scene* scene = nullptr;
  const char* isa = nullptr;
  MemoryBudget budget;
  std::vector<std::unique_ptr<MaskedMesh>> masked;
  RTCDevice device = nullptr;
  RTCScene embree = nullptr;
  // Every hit lies in the sphere around the scene's box.
  Vec3 centre;
  float radius = 0;

  Impl(const Scene& scene_, const TracerOptions& options);
  ~Impl() {
    if (embree) rtcReleaseScene(embree);
    if (device) rtcReleaseDevice(device);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void check() const;
  void attach(size_t index, const TracerOptions& options);
  void build(const TracerOptions& options);
  bool prepare(const Ray& ray, RTCRay* out, RayCounters& counters) const;
  uint32_t prepare16(const RayPacket16& packet, RTCRay16* out, int32_t valid[16],
                     RayCounters& counters) const;
};

Tracer::Impl::Impl(const Scene& scene_, const TracerOptions& options) : scene(&scene_) {
  isa = options.pin_isa ? pinned_isa() : unpinned_isa();
  std::string config = "threads=" + std::to_string(granted_threads(options.build_threads));
  if (options.pin_isa) config += std::string(",isa=") + isa;
  device = rtcNewDevice(config.c_str());
  if (!device) throw Error(ErrorCode::internal, "The ray tracing device could not be created.");
  budget.limit = static_cast<int64_t>(std::min<uint64_t>(options.max_memory_bytes, INT64_MAX));
  rtcSetDeviceMemoryMonitorFunction(device, watch_memory, &budget);
  try {
    build(options);
  } catch (...) {
    if (embree) rtcReleaseScene(embree);
    rtcReleaseDevice(device);
    embree = nullptr;
    device = nullptr;
    throw;
  }
}

void Tracer::Impl::check() const {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_NONE) return;
  if (error == RTC_ERROR_OUT_OF_MEMORY)
    throw Error(ErrorCode::out_of_memory,
                "The scene needs more memory for ray tracing than is granted (" +
                    std::to_string(budget.limit) + " bytes).");
  throw Error(ErrorCode::internal,
              "The ray tracing library reported error " + std::to_string(error) + ".");
}

void Tracer::Impl::build(const TracerOptions& options) {
  uint64_t triangles = 0;
  for (const SurfaceMesh& mesh : scene->meshes) triangles += mesh.triangles.size();
  constexpr uint64_t kMostTriangles = 1u << 30;
  if (triangles > kMostTriangles)
    throw Error(ErrorCode::too_large, "The scene has " + std::to_string(triangles) +
                                          " triangles; at most " + std::to_string(kMostTriangles) +
                                          " are allowed.");
  embree = rtcNewScene(device);
  check();
  rtcSetSceneBuildQuality(embree, RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSceneFlags(embree, options.robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
  for (size_t i = 0; i < scene->meshes.size(); ++i) attach(i, options);
  rtcCommitScene(embree);
  check();

  Bounds bounds;
  for (const SurfaceMesh& mesh : scene->meshes)
    for (const Vec3& p : mesh.positions)
      for (int axis = 0; axis < 3; ++axis) {
        const double value = p[axis];
        bounds.lower[axis] = std::min(bounds.lower[axis], value);
        bounds.upper[axis] = std::max(bounds.upper[axis], value);
      }
  if (bounds.empty()) return;
  centre = to_float((bounds.lower + bounds.upper) * 0.5);
  radius = static_cast<float>(0.5005 * length(bounds.extent()));
}

void Tracer::Impl::attach(size_t index, const TracerOptions& options) {
  const SurfaceMesh& mesh = scene->meshes[index];
  if (mesh.triangles.empty()) return;
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  check();
  auto* positions = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), mesh.positions.size()));
  auto* indices = static_cast<uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(uint32_t), mesh.triangles.size()));
  if (!positions || !indices) {
    rtcReleaseGeometry(geometry);
    check();
    throw Error(ErrorCode::internal, "The ray tracing library gave no buffer.");
  }
  for (const Vec3& p : mesh.positions) {
    *positions++ = p.x;
    *positions++ = p.y;
    *positions++ = p.z;
  }
  for (const auto& triangle : mesh.triangles) indices = std::copy_n(triangle.data(), 3, indices);
  if (options.alpha_test && needs_alpha_test(*scene, mesh)) {
    const Material& material = scene->materials[static_cast<size_t>(mesh.material)];
    masked.push_back(std::make_unique<MaskedMesh>(scene, &mesh, material.alpha_cutoff));
    rtcSetGeometryUserData(geometry, masked.back().get());
    rtcSetGeometryIntersectFilterFunction(geometry, alpha_filter);
    rtcSetGeometryOccludedFilterFunction(geometry, alpha_filter);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(embree, geometry, static_cast<unsigned int>(index));
  rtcReleaseGeometry(geometry);
  check();
}

namespace {

bool in_range(float value) {
  return std::fabs(value) <= kLargestComponent;  // false for NaN
}

// No surface lies farther from o than |o - c| + r, where (c, r) is the sphere around the scene, so
// a hit with t |d| beyond that is an artefact of a sliver seen at a grazing angle. Ending the ray
// there costs a square root and keeps such hits from ever being reported.
float reach_limit(float to_centre2, float direction2, float radius) {
  return (std::sqrt(to_centre2) * 1.0005f + radius) / std::sqrt(direction2);
}

}  // namespace

// The gate for one ray: false (and counted) when Embree must not see it.
bool Tracer::Impl::prepare(const Ray& ray, RTCRay* out, RayCounters& counters) const {
  const Vec3& o = ray.origin;
  const Vec3& d = ray.direction;
  const bool good = in_range(o.x) & in_range(o.y) & in_range(o.z) & in_range(d.x) & in_range(d.y) &
                    in_range(d.z) & (ray.t_near >= 0) & in_range(ray.t_near) &
                    (ray.t_far == ray.t_far);
  if (!good) {
    ++counters.rejected_rays;
    return false;
  }
  const Vec3 to_centre = o - centre;
  const float limit = reach_limit(dot(to_centre, to_centre), dot(d, d), radius);
  out->org_x = o.x;
  out->org_y = o.y;
  out->org_z = o.z;
  out->tnear = ray.t_near;
  out->dir_x = d.x;
  out->dir_y = d.y;
  out->dir_z = d.z;
  out->time = 0;
  out->tfar = limit < ray.t_far ? limit : ray.t_far;
  out->mask = 0xffffffffu;
  out->id = 0;
  out->flags = 0;
  return true;
}

// The same gate, sixteen lanes at once. Returns the number of rays left to trace. Lanes that are
// not traced are filled with zeros: on instruction sets without native packets of sixteen,
// Embree 3.13 asserts on their contents although their valid flag is off.
uint32_t Tracer::Impl::prepare16(const RayPacket16& p, RTCRay16* out, int32_t valid[16],
                                 RayCounters& counters) const {
  int32_t wanted = 0;
  int32_t kept = 0;
  for (int i = 0; i < 16; ++i) {
    const bool good = in_range(p.origin_x[i]) & in_range(p.origin_y[i]) & in_range(p.origin_z[i]) &
                      in_range(p.direction_x[i]) & in_range(p.direction_y[i]) &
                      in_range(p.direction_z[i]) & (p.t_near[i] >= 0) & in_range(p.t_near[i]) &
                      (p.t_far[i] == p.t_far[i]);
    const int32_t asked = p.valid[i] != 0 ? 1 : 0;
    const int32_t keep = good ? asked : 0;
    valid[i] = -keep;
    wanted += asked;
    kept += keep;
  }
  counters.rejected_rays += static_cast<uint64_t>(wanted - kept);
  for (int i = 0; i < 16; ++i) {
    out->org_x[i] = p.origin_x[i];
    out->org_y[i] = p.origin_y[i];
    out->org_z[i] = p.origin_z[i];
    out->dir_x[i] = p.direction_x[i];
    out->dir_y[i] = p.direction_y[i];
    out->dir_z[i] = p.direction_z[i];
    out->tnear[i] = p.t_near[i];
    out->tfar[i] = p.t_far[i];
    out->time[i] = 0;
    out->mask[i] = 0xffffffffu;
    out->id[i] = 0;
    out->flags[i] = 0;
  }
  if (kept < 16)
    for (int i = 0; i < 16; ++i)
      if (valid[i] == 0)
        out->org_x[i] = out->org_y[i] = out->org_z[i] = out->dir_x[i] = out->dir_y[i] =
            out->dir_z[i] = out->tnear[i] = out->tfar[i] = 0;
  for (int i = 0; i < 16; ++i) {
    const float x = out->org_x[i] - centre.x;
    const float y = out->org_y[i] - centre.y;
    const float z = out->org_z[i] - centre.z;
    const float dx = out->dir_x[i];
    const float dy = out->dir_y[i];
    const float dz = out->dir_z[i];
    const float limit = reach_limit(x * x + y * y + z * z, dx * dx + dy * dy + dz * dz, radius);
    out->tfar[i] = limit < out->tfar[i] ? limit : out->tfar[i];
  }
  return static_cast<uint32_t>(kept);
}

Tracer::Tracer(const Scene& scene, const TracerOptions& options)
    : impl_(std::make_unique<Impl>(scene, options)) {}
Tracer::~Tracer() = default;
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;

const Scene& Tracer::scene() const {
  return *impl_->scene;
}
const char* Tracer::isa() const {
  return impl_->isa;
}

Hit Tracer::nearest(const Ray& ray, RayCounters& counters) const {
  Hit result;
  RTCRayHit query;
  if (!impl_->prepare(ray, &query.ray, counters)) return result;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  Context context(counters);
  rtcIntersect1(impl_->embree, &context.embree, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return result;
  result.t = query.ray.tfar;
  result.mesh = query.hit.geomID;
  result.triangle = query.hit.primID;
  result.u = query.hit.u;
  result.v = query.hit.v;
  return result;
}

bool Tracer::occluded(const Ray& ray, RayCounters& counters) const {
  RTCRay query;
  if (!impl_->prepare(ray, &query, counters)) return false;
  Context context(counters);
  rtcOccluded1(impl_->embree, &context.embree, &query);
  return query.tfar == -INFINITY;
}

uint32_t Tracer::occluded16(const RayPacket16& packet, RayCounters& counters) const {
  RTCRay16 rays;
  alignas(64) int32_t valid[16];
  if (impl_->prepare16(packet, &rays, valid, counters) == 0) return 0;
  Context context(counters);
  rtcOccluded16(valid, impl_->embree, &context.embree, &rays);
  uint32_t mask = 0;
  for (uint32_t i = 0; i < 16; ++i)
    mask |= (valid[i] != 0 && rays.tfar[i] == -INFINITY ? 1u : 0u) << i;
  return mask;
}

void Tracer::nearest16(const RayPacket16& packet, float t_hit[16], RayCounters& counters) const {
  RTCRayHit16 query;
  alignas(64) int32_t valid[16];
  std::fill_n(t_hit, 16, INFINITY);
  if (impl_->prepare16(packet, &query.ray, valid, counters) == 0) return;
  for (int i = 0; i < 16; ++i) {
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  Context context(counters);
  rtcIntersect16(valid, impl_->embree, &context.embree, &query);
  for (int i = 0; i < 16; ++i)
    if (valid[i] != 0 && query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID)
      t_hit[i] = query.ray.tfar[i];
}

namespace {

struct ClearSearch {
  const Scene* scene;
  std::span<const HalfSpace> half_spaces;
  int visits_left = 256;
  bool clear = true;
};

// Squared distance from p to the box around a triangle.
double box_distance2(const SurfaceMesh& mesh, const std::array<uint32_t, 3>& triangle,
                     const Vec3d& p) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = static_cast<double>(mesh.positions[triangle[0]][axis]);
    const double b = static_cast<double>(mesh.positions[triangle[1]][axis]);
    const double c = static_cast<double>(mesh.positions[triangle[2]][axis]);
    const double outside =
        std::max({std::min({a, b, c}) - p[axis], p[axis] - std::max({a, b, c}), 0.0});
    sum += outside * outside;
  }
  return sum;
}

// Embree calls this for the triangles of every leaf whose box meets the sphere. Shrinking the
// radius to nothing ends the search.
bool visit_triangle(RTCPointQueryFunctionArguments* args) {
  ClearSearch& search = *static_cast<ClearSearch*>(args->userPtr);
  const SurfaceMesh& mesh = search.scene->meshes[args->geomID];
  const Vec3d around{args->query->x, args->query->y, args->query->z};
  const double radius = args->query->radius;
  if (box_distance2(mesh, mesh.triangles[args->primID], around) > radius * radius) return false;
  bool below = search.visits_left-- > 0;
  for (const HalfSpace& space : search.half_spaces)
    for (const uint32_t corner : mesh.triangles[args->primID])
      below &= dot(to_double(space.normal),
                   to_double(mesh.positions[corner]) - to_double(space.point)) <= 0;
  if (below) return false;
  search.clear = false;
  args->query->radius = 0;
  return true;
}

}  // namespace

bool Tracer::surely_clear(const Vec3& around, float radius, std::span<const HalfSpace> half_spaces,
                          RayCounters& counters) const {
  if (!in_range(around.x) || !in_range(around.y) || !in_range(around.z) || !(radius >= 0))
    return false;
  ++counters.point_queries;
  ClearSearch search{impl_->scene, half_spaces};
  RTCPointQuery query{};
  query.x = around.x;
  query.y = around.y;
  query.z = around.z;
  query.radius = radius;
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->embree, &query, &context, visit_triangle, &search);
  return search.clear;
}

}  // namespace lightkiln

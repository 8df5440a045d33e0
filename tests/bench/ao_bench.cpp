// The inner loop of ambient occlusion against a bare rtcOccluded16 loop over the very same rays,
// single threaded and interleaved, so that a noisy machine disturbs both alike.
//
//   bench_ao [--smoke] [scene.glb]

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include <embree3/rtcore.h>

#include "core/bake/openness.h"
#include "core/bake/vertex_facets.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/scene/gltf.h"
#include "tests/support/data.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln {
namespace {

struct Order {
  size_t vertices;
  uint64_t samples;
  int repetitions;
};

// A floor under a crowd of spheres: corners, near and far occluders, open sky.
Scene crowd(int divisions) {
  test::MeshData mesh = test::make_grid(10, divisions);
  for (int i = 0; i < 60; ++i) {
    const uint64_t h = hash64(static_cast<uint64_t>(i));
    const auto part = [&](int shift) {
      return static_cast<float>(h >> shift & 0xffffu) / 65536.0f;
    };
    const float radius = 0.2f + part(0);
    mesh = test::merged(mesh, test::make_sphere({18 * part(16) - 9, radius, 18 * part(32) - 9},
                                                radius, divisions / 8, divisions / 4));
  }
  return test::scene_from_triangles(mesh);
}

// Embree without the tracer: same scene flags, same instruction set.
class BareScene {
 public:
  BareScene(const Scene& scene, const char* isa) {
    device_ = rtcNewDevice((std::string("threads=1,isa=") + isa).c_str());
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    for (const SurfaceMesh& mesh : scene.meshes) {
      const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      std::memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                          sizeof(Vec3), mesh.positions.size()),
                  mesh.positions.data(), mesh.positions.size() * sizeof(Vec3));
      std::memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12,
                                          mesh.triangles.size()),
                  mesh.triangles.data(), mesh.triangles.size() * 12);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene_, geometry);
      rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(scene_);
  }
  ~BareScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  BareScene(const BareScene&) = delete;
  BareScene& operator=(const BareScene&) = delete;

  // Occluded rays among the packets; the shortest loop there is.
  uint64_t count(const std::vector<RTCRay16>& packets) const {
    alignas(64) int valid[16];
    std::fill_n(valid, 16, -1);
    uint64_t occluded = 0;
    for (const RTCRay16& packet : packets) {
      RTCRay16 rays = packet;
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      rtcOccluded16(valid, scene_, &context, &rays);
      for (const float t_far : rays.tfar) occluded += t_far < 0;
    }
    return occluded;
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

RTCRay16 to_embree(const RayPacket16& packet) {
  RTCRay16 rays{};
  std::copy_n(packet.origin_x, 16, rays.org_x);
  std::copy_n(packet.origin_y, 16, rays.org_y);
  std::copy_n(packet.origin_z, 16, rays.org_z);
  std::copy_n(packet.direction_x, 16, rays.dir_x);
  std::copy_n(packet.direction_y, 16, rays.dir_y);
  std::copy_n(packet.direction_z, 16, rays.dir_z);
  std::copy_n(packet.t_near, 16, rays.tnear);
  std::copy_n(packet.t_far, 16, rays.tfar);
  std::fill_n(rays.mask, 16, 0xffffffffu);
  return rays;
}

// Prints a line; false when the two loops disagree on what is occluded.
bool compare(const char* name, const Scene& scene, const Order& order) {
  const Tracer tracer(scene, {});
  const BareScene bare(scene, tracer.isa());
  OpennessParameters parameters;
  parameters.target_error = 0;
  parameters.max_samples = order.samples;
  const OpennessKernel kernel(tracer, parameters);
  const VertexFacets vertices(scene);

  std::vector<Facet> facets;
  std::vector<size_t> first{0};
  std::vector<OpennessElement> elements;
  const size_t count = std::min<size_t>(order.vertices, vertices.vertices());
  const uint64_t start = (vertices.vertices() - count) / 2;
  for (size_t i = 0; i < count; ++i) {
    vertices.facets(start + i, &facets);
    first.push_back(facets.size());
  }
  std::vector<RTCRay16> packets;
  for (size_t i = 0; i < count; ++i) {
    elements.push_back({start + i, std::span(facets).subspan(first[i], first[i + 1] - first[i])});
    for (int level = 0; 256u << level <= order.samples && first[i] != first[i + 1]; ++level)
      for (const RayPacket16& packet : kernel.packets(elements.back(), level))
        packets.push_back(to_embree(packet));
  }
  const double rays = 16.0 * static_cast<double>(packets.size());

  const FlushDenormals guard;
  std::vector<double> ratios, ours, theirs;
  std::vector<OpennessEstimate> estimates(count);
  bool agree = true;
  for (int i = 0; i < order.repetitions; ++i) {
    const double t0 = thread_cpu_seconds();
    const uint64_t occluded = bare.count(packets);
    const double t1 = thread_cpu_seconds();
    ChunkReport report;
    for (size_t begin = 0; begin < count; begin += 64) {
      const size_t size = std::min<size_t>(64, count - begin);
      ChunkReport block;
      kernel.estimate(std::span(elements).subspan(begin, size),
                      std::span(estimates).subspan(begin, size), &block, Progress());
    }
    const double t2 = thread_cpu_seconds();
    double closed = 0;
    for (const OpennessEstimate& e : estimates) closed += (1 - e.openness) * e.samples;
    agree = agree && std::abs(closed - static_cast<double>(occluded)) < 0.5;
    theirs.push_back(t1 - t0);
    ours.push_back(t2 - t1);
    ratios.push_back((t1 - t0) / (t2 - t1));
  }
  const auto middle = [](std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
  };
  std::printf("%-24s %8.0f rays  bare %5.2f  ours %5.2f Mrays/s  share: median %.3f  min %.3f%s\n",
              name, rays, 1e-6 * rays / middle(theirs), 1e-6 * rays / middle(ours), middle(ratios),
              *std::min_element(ratios.begin(), ratios.end()), agree ? "" : "  DISAGREE");
  return agree;
}

}  // namespace
}  // namespace lightkiln

int main(int argc, char** argv) {
  using namespace lightkiln;
  bool smoke = false;
  std::string file;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--smoke") {
      smoke = true;
    } else {
      file = argv[i];
    }
  }
  std::printf("ambient occlusion inner loop, one thread, isa pinned, robust, infinite distance\n");
  if (smoke) return compare("crowd, tiny", crowd(16), {64, 256, 2}) ? 0 : 1;
  bool agree = compare("crowd, 256 samples", crowd(160), {2048, 256, 15});
  agree = compare("crowd, 1024 samples", crowd(160), {512, 1024, 15}) && agree;
  if (file.empty() && test::data_folder())
    file = *test::data_folder() / "scenes/interior_hotel_room/hotel-room.decoded.glb";
  if (!file.empty()) {
    const std::vector<std::byte> bytes = test::read_file(file);
    const Scene scene = load_gltf({bytes, {}}, {.textures = false, .limits = {}});
    agree = compare("file, 256 samples", scene, {2048, 256, 15}) && agree;
    agree = compare("file, 1024 samples", scene, {512, 1024, 15}) && agree;
  }
  return agree ? 0 : 1;
}

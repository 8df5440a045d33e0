// Rays that must never reach Embree, whose assertions would end the process.
// Tags beside tests are explained in tests/support/hard_cases.h.

#include <cmath>
#include <cstring>
#include <limits>

#include <embree3/rtcore.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/parallel.h"
#include "core/trace/tracer.h"
#include "tests/trace/raw_scene.h"

namespace lightkiln {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = INFINITY;

struct OddRay {
  const char* what;
  Ray ray;
  bool hits;
  bool rejected;
};

// The scene is a unit sphere about the origin; a plain ray from outside along -z hits it.
const OddRay kOddRays[] = {
    {"plain", {{0.03f, 0.02f, 2}, {0, 0, -1}, 0, kInf}, true, false},
    {"NaN origin", {{kNan, 0, 2}, {0, 0, -1}, 0, kInf}, false, true},
    {"infinite origin", {{0, kInf, 2}, {0, 0, -1}, 0, kInf}, false, true},
    {"NaN direction", {{0.03f, 0.02f, 2}, {0, 0, kNan}, 0, kInf}, false, true},
    {"infinite direction", {{0.03f, 0.02f, 2}, {0, 0, -kInf}, 0, kInf}, false, true},
    {"huge origin", {{0, 0, 1e19f}, {0, 0, -1}, 0, kInf}, false, true},
    {"negative start", {{0.03f, 0.02f, 2}, {0, 0, -1}, -1, kInf}, false, true},
    {"NaN start", {{0.03f, 0.02f, 2}, {0, 0, -1}, kNan, kInf}, false, true},
    {"NaN end", {{0.03f, 0.02f, 2}, {0, 0, -1}, 0, kNan}, false, true},
    {"zero direction", {{0.03f, 0.02f, 2}, {0, 0, 0}, 0, kInf}, false, false},
    {"start after end", {{0.03f, 0.02f, 2}, {0, 0, -1}, 3, 2}, false, false},
    {"negative end", {{0.03f, 0.02f, 2}, {0, 0, -1}, 0, -1}, false, false},
    {"direction of 1e-15", {{0.03f, 0.02f, 2}, {0, 0, -1e-15f}, 0, kInf}, true, false},
    {"direction of 1e-30", {{0.03f, 0.02f, 2}, {0, 0, -1e-30f}, 0, kInf}, false, false},
    {"denormal direction", {{0.03f, 0.02f, 2}, {0, 0, -1e-40f}, 0, kInf}, false, false},
};

TEST(OddRays, HaveTheirStatedOutcomeAloneAndInPackets) {  // G11
  const FlushDenormals guard;
  const Scene scene = test::raw_scene(test::make_sphere({0, 0, 0}, 1));
  const Tracer tracer(scene, {});
  for (const OddRay& odd : kOddRays) {
    RayCounters counters;
    EXPECT_EQ(tracer.nearest(odd.ray, counters).hit(), odd.hits) << odd.what;
    EXPECT_EQ(tracer.occluded(odd.ray, counters), odd.hits) << odd.what;
    EXPECT_EQ(counters.rejected_rays, odd.rejected ? 2u : 0u) << odd.what;

    // In lane 7 of a packet of plain rays, the others keep their answer.
    RayPacket16 packet;
    for (size_t k = 0; k < 16; ++k) {
      const Ray& ray = k == 7 ? odd.ray : kOddRays[0].ray;
      packet.origin_x[k] = ray.origin.x;
      packet.origin_y[k] = ray.origin.y;
      packet.origin_z[k] = ray.origin.z;
      packet.direction_x[k] = ray.direction.x;
      packet.direction_y[k] = ray.direction.y;
      packet.direction_z[k] = ray.direction.z;
      packet.t_near[k] = ray.t_near;
      packet.t_far[k] = ray.t_far;
      packet.valid[k] = -1;
    }
    RayCounters packets;
    EXPECT_EQ(tracer.occluded16(packet, packets), odd.hits ? 0xffffu : 0xff7fu) << odd.what;
    EXPECT_EQ(packets.rejected_rays, odd.rejected ? 1u : 0u) << odd.what;
  }
}

// What happens in a child process that hands the ray to Embree without the gate.
int ungated_exit(const Ray& ray) {
  const pid_t child = fork();
  if (child == 0) {
    if (!freopen("/dev/null", "w", stderr)) _exit(3);
    const RTCDevice device = rtcNewDevice("threads=1");
    const RTCScene scene = rtcNewScene(device);
    const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const float corners[9] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    const unsigned int triangle[3] = {0, 1, 2};
    std::memcpy(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3),
        corners, sizeof corners);
    std::memcpy(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1),
        triangle, sizeof triangle);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    RTCRay query{};
    query.org_x = ray.origin.x;
    query.org_y = ray.origin.y;
    query.org_z = ray.origin.z;
    query.dir_x = ray.direction.x;
    query.dir_y = ray.direction.y;
    query.dir_z = ray.direction.z;
    query.tnear = ray.t_near;
    query.tfar = ray.t_far;
    query.mask = 0xffffffffu;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &query);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

TEST(OddRays, WouldEndTheProcessWithoutTheGate) {  // G11, positive control
  const int plain = ungated_exit(kOddRays[0].ray);
  ASSERT_TRUE(WIFEXITED(plain) && WEXITSTATUS(plain) == 0);
  const int nan = ungated_exit(kOddRays[1].ray);
  if (WIFEXITED(nan)) GTEST_SKIP() << "this Embree was built without assertions";
  EXPECT_TRUE(WIFSIGNALED(nan));
}

}  // namespace
}  // namespace lightkiln

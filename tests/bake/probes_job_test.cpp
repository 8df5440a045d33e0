#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

const std::string kDigest = "sha256:" + std::string(64, 'a');

// A room of 8 m a side in albedo 0.5 that shines with 1 + 0.5 + 0.25 + ... = 2 in every direction,
// as a client would order it.
struct Job {
  std::vector<std::byte> glb;
  Spec spec;

  Job() {
    MeshData walls = reversed(make_box({1, 2, 3}, {9, 10, 11}));
    glb = make_glb(walls, grey(0.5f, 1));
    ProbesParameters parameters;
    parameters.positions = {{5, 6, 7}, {3, 6, 7}, {20, 6, 7}};
    parameters.cubemap.size = 4;
    spec.parameters = parameters;
    spec.scene = InputRef{kDigest, {}};
    spec.accuracy.target_error = 0.01;
  }
  Assembly bake(Plan* plan = nullptr, int threads = 1) const {
    Inputs inputs;
    inputs.blobs[kDigest] = glb;
    Grants grants;
    grants.threads = threads;
    Progress progress;
    return bake_all(spec, inputs, grants, progress, plan);
  }
};

TEST(ProbesJob, GivesTwoImagesAProbeAndADocument) {
  Plan plan;
  const Assembly result = Job().bake(&plan);
  EXPECT_EQ(plan.kind, Kind::probes);
  EXPECT_EQ(plan.elements, 3u);
  EXPECT_EQ(plan.element_unit, "probe");
  EXPECT_EQ(plan.prices.size(), 5u);
  EXPECT_FALSE(plan.effects.empty());
  ASSERT_EQ(result.artifacts.size(), 6u);
  const char* const names[] = {"probe_0000_radiance.exr", "probe_0000_distance.exr",
                               "probe_0001_radiance.exr", "probe_0001_distance.exr",
                               "probe_0002_radiance.exr", "probe_0002_distance.exr"};
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(result.artifacts[i].name, names[i]);
    EXPECT_EQ(result.artifacts[i].media_type, "image/x-exr");
    const DecodedImage decoded = read_exr(result.artifacts[i].bytes);
    EXPECT_EQ(decoded.image.width, 4);
    EXPECT_EQ(decoded.image.height, 24);
    EXPECT_EQ(decoded.image.channels, i % 2 == 0 ? 3 : 1);
    // Texel centres lie at (i + 1/2)/N, so the standard attribute must not claim otherwise.
    EXPECT_EQ(decoded.envmap, EnvmapAttribute::none);
  }
  const Image radiance = read_exr(result.artifacts[0].bytes).image;
  for (const float value : radiance.pixels) EXPECT_NEAR(value, 2, 0.01);

  const auto& document = std::get<ProbesDocument>(result.document);
  EXPECT_EQ(document.cubemap_size, 4);
  ASSERT_EQ(document.probes.size(), 3u);
  EXPECT_EQ(document.probes[0].status, ProbeStatus::valid);
  EXPECT_NEAR(document.probes[0].distance_min, 4, 0.02);
  EXPECT_NEAR(document.probes[1].distance_min, 2, 0.02);
  EXPECT_EQ(document.probes[2].status, ProbeStatus::inside_geometry);  // backs all round
  EXPECT_EQ(document.probes[1].position, (Vec3d{3, 6, 7}));
  EXPECT_EQ(document.probes[1].radiance_artifact, "probe_0001_radiance.exr");
}

TEST(ProbesJob, SelftestTellsWhatTheCoefficientsGive) {
  const Assembly result = Job().bake();
  const ProbeDocument& probe = std::get<ProbesDocument>(result.document).probes[0];
  ASSERT_EQ(probe.sh.selftest.size(), 6u);
  for (const ShSelftest& test : probe.sh.selftest) {
    EXPECT_NEAR(test.radiance.y, 2, 0.02);
    EXPECT_NEAR(test.irradiance.y, 2 * kPi, 0.02 * kPi);
  }
}

TEST(ProbesJob, AccuracyCountsWhatWasTraced) {
  Plan plan;
  const Assembly result = Job().bake(&plan);
  const AccuracyRecord& accuracy = result.accuracy;
  EXPECT_EQ(accuracy.status, AccuracyStatus::converged);
  EXPECT_EQ(accuracy.elements, 3u);
  EXPECT_EQ(accuracy.converged_share, 1);
  EXPECT_EQ(accuracy.target_error, 0.01);
  EXPECT_EQ(accuracy.predicted_s, plan.predicted_s);
  EXPECT_LE(plan.predicted_low_s, plan.predicted_s);
  EXPECT_GE(plan.predicted_high_s, plan.predicted_s);
  EXPECT_EQ(accuracy.bias_bound, plan.bias_bound);
  EXPECT_LE(accuracy.error_max + accuracy.bias_bound, accuracy.target_error);
  ASSERT_FALSE(accuracy.rounds.empty());
  EXPECT_EQ(accuracy.rounds[0].samples, 64u);
  EXPECT_EQ(accuracy.counters.shadow_rays, 0u);
  EXPECT_EQ(accuracy.counters.texture_reads, 0u);
  uint64_t rays = 0;
  for (const Round& round : accuracy.rounds) rays += round.rays;
  // Beside the rounds, each probe looks around with 1024 rays and once through each texel.
  EXPECT_EQ(accuracy.counters.nearest_rays + accuracy.counters.bounce_rays, rays + 3 * (1024 + 96));
}

// Results that no process could hold are refused before anything is loaded.
TEST(ProbesJob, MoreThanMemoryHoldsIsTooLarge) {
  Job job;
  auto& parameters = std::get<ProbesParameters>(job.spec.parameters);
  parameters.cubemap.size = 512;
  const uint64_t most = kMostProbeBytes / probe_bytes(parameters);
  EXPECT_EQ(most, 42u);
  parameters.positions.assign(most, {0, 0, 0});
  EXPECT_TRUE(validate(job.spec).empty());
  for (const size_t count : {size_t{43}, size_t{10000}}) {
    parameters.positions.assign(count, {0, 0, 0});
    const std::vector<SpecFault> faults = validate(job.spec);
    ASSERT_EQ(faults.size(), 1u);
    EXPECT_EQ(faults[0].pointer, "/parameters/positions");
    EXPECT_EQ(faults[0].code, "too_large");
    EXPECT_NE(faults[0].allowed.find("at most 42 positions"), std::string::npos);
    try {
      job.bake();
      FAIL() << count;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::too_large);
      EXPECT_EQ(error.where(), "/parameters/positions");
    }
  }
  parameters.cubemap.size = 64;
  EXPECT_EQ(kMostProbeBytes / probe_bytes(parameters), 2729u);
}

TEST(ProbesJob, SameOrderSameBytes) {
  const Job job;
  const Assembly one = job.bake(nullptr, 1), two = job.bake(nullptr, 2);
  for (size_t i = 0; i < one.artifacts.size(); ++i) {
    EXPECT_EQ(one.artifacts[i].bytes, two.artifacts[i].bytes) << one.artifacts[i].name;
  }
}

// A probe beside a wall, so that no two faces are alike.
TEST(ProbesJob, WritesItsCubesAsGraphicsInterfacesLookThemUp) {
  Job job;
  auto& parameters = std::get<ProbesParameters>(job.spec.parameters);
  parameters.positions = {{2, 6, 10}};
  const Assembly ours = job.bake();
  parameters.cubes.face_orientation = FaceOrientation::opengl;
  EXPECT_TRUE(validate(job.spec).empty());
  const Assembly theirs = job.bake();
  EXPECT_EQ(std::get<ProbesDocument>(ours.document).faces, FaceOrientation::openexr);
  EXPECT_EQ(std::get<ProbesDocument>(theirs.document).faces, FaceOrientation::opengl);
  ASSERT_EQ(theirs.artifacts.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const auto &a = ours.artifacts[i].bytes, &b = theirs.artifacts[i].bytes;
    EXPECT_EQ(strip_to_opengl(read_exr(a).image).pixels, read_exr(b).image.pixels);
    EXPECT_EQ(exr_text(a, kFaceOrientationAttribute), "");
    EXPECT_EQ(exr_text(b, kFaceOrientationAttribute), "opengl");
    EXPECT_EQ(read_exr(b).envmap, EnvmapAttribute::none);
  }
  // The nearest wall, 1 m away at -X of ours, is ahead of +X of theirs.
  const Image distance = read_exr(theirs.artifacts[1].bytes).image;
  EXPECT_NEAR(*distance.at(1, 1), 1, 0.2);
  EXPECT_GT(*distance.at(1, 5), 6);
}

TEST(ProbesJob, WarnsOfAnEnvironmentThatIsNotWhatItIsReadAs) {
  Job job;
  auto& parameters = std::get<ProbesParameters>(job.spec.parameters);
  parameters.source.layout = LayoutKind::cube_strip;
  ExrWriteOptions options;
  options.attributes[kFaceOrientationAttribute] = "opengl";
  const std::vector<std::byte> sky = write_exr(Image(4, 24, 3), options);
  const std::string digest = "sha256:" + std::string(64, 'b');
  job.spec.environment = InputRef{digest, {}};
  const Inputs inputs{{{kDigest, job.glb}, {digest, sky}}};
  const auto warnings = [&] {
    Progress progress;
    std::vector<std::string> all = Bake(job.spec, inputs, {1, 0, 4}).plan(progress).warnings;
    return std::count_if(all.begin(), all.end(), [](const std::string& warning) {
      return warning.find("turned as opengl") != std::string::npos;
    });
  };
  EXPECT_EQ(warnings(), 1);
  parameters.source.face_orientation = FaceOrientation::opengl;
  EXPECT_EQ(warnings(), 0);
}

// Power-of-two scales change exponents only.
TEST(ProbesJob, ScaleOfTheWorldLeavesRadianceAlone) {
  Job job;
  const Assembly plain = job.bake();
  MeshData walls = reversed(make_box({1, 2, 3}, {9, 10, 11}));
  job.glb = make_glb(scaled(walls, 0x1p20f), grey(0.5f, 1));
  auto& parameters = std::get<ProbesParameters>(job.spec.parameters);
  for (Vec3d& position : parameters.positions) position *= 0x1p20;
  const Assembly large = job.bake();
  for (size_t i = 0; i < plain.artifacts.size(); i += 2) {
    const Image a = read_exr(plain.artifacts[i].bytes).image;
    const Image b = read_exr(large.artifacts[i].bytes).image;
    EXPECT_EQ(a.pixels, b.pixels);
  }
  const Image a = read_exr(plain.artifacts[1].bytes).image;
  const Image b = read_exr(large.artifacts[1].bytes).image;
  for (size_t i = 0; i < a.pixels.size(); ++i) EXPECT_EQ(a.pixels[i] * 0x1p20f, b.pixels[i]);
}

}  // namespace
}  // namespace lightkiln::test

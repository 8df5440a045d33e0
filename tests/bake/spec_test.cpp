#include "core/bake/spec.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/kitchen.h"

namespace lightkiln {
namespace {

const std::string kDigest = "sha256:" + std::string(64, 'f');

// "pointer code" of every fault.
std::vector<std::string> faults(const Spec& spec) {
  std::vector<std::string> all;
  for (const SpecFault& fault : validate(spec)) {
    all.push_back(fault.pointer + " " + fault.code);
    EXPECT_FALSE(fault.message.empty());
  }
  return all;
}
bool has(const std::vector<std::string>& all, const std::string& one) {
  return std::find(all.begin(), all.end(), one) != all.end();
}

Spec ao() {
  Spec spec;
  spec.scene = InputRef{kDigest, {}};
  spec.parameters = AmbientOcclusionParameters{};
  return spec;
}
Spec maps() {
  Spec spec;
  spec.environment = InputRef{kDigest, {}};
  EnvironmentMapsParameters p;
  p.sh = ShOutput{};
  p.irradiance = IrradianceOutput{};
  p.prefilter = PrefilterOutput{};
  p.dfg = DfgOutput{};
  p.spectrum = SpectrumOutput{};
  spec.parameters = p;
  return spec;
}
Spec probes() {
  Spec spec;
  spec.scene = InputRef{kDigest, {}};
  ProbesParameters p;
  p.positions = {{0, 0, 0}};
  spec.parameters = p;
  return spec;
}

TEST(Spec, DefaultsOfEveryKindCanBeOrdered) {
  for (const Spec& spec : {ao(), maps(), probes()})
    EXPECT_EQ(faults(spec), std::vector<std::string>{});
}

TEST(Spec, AWindowsQuantityNeedsAWindow) {
  Spec spec = maps();
  ShOutput& sh = *std::get<EnvironmentMapsParameters>(spec.parameters).sh;
  sh.window_quantity = ShQuantity::radiance;
  EXPECT_EQ(faults(spec), std::vector<std::string>{"/parameters/sh/window_quantity conflict"});
  sh.window = ShWindow::hann;
  EXPECT_EQ(faults(spec), std::vector<std::string>{});
  sh.exports = 1u << 7;
  EXPECT_EQ(faults(spec), std::vector<std::string>{"/parameters/sh/exports range"});
}

TEST(Spec, KindsHaveTheirOwnDefaultErrorAndNames) {
  EXPECT_EQ(target_error(ao()), 0.02);
  EXPECT_EQ(target_error(maps()), 0.001);
  EXPECT_EQ(target_error(probes()), 0.05);
  EXPECT_STREQ(kind_name(probes().kind()), "probes");
  Spec spec = ao();
  EXPECT_EQ(max_samples(spec), 65536u);
  spec.accuracy.max_samples = 1000;
  EXPECT_EQ(max_samples(spec), 1024u);
}

TEST(Spec, InputsAreThoseOfTheKind) {
  Spec spec = ao();
  spec.environment = InputRef{kDigest, {}};
  EXPECT_TRUE(has(faults(spec), "/inputs/environment conflict"));
  spec = maps();
  std::swap(spec.scene, spec.environment);
  EXPECT_TRUE(has(faults(spec), "/inputs/environment missing"));
  EXPECT_TRUE(has(faults(spec), "/inputs/scene conflict"));
  spec = probes();
  spec.environment = InputRef{kDigest, {}};
  EXPECT_TRUE(faults(spec).empty());
}

TEST(Spec, DigestsAndResourceNamesAreChecked) {
  for (const std::string& wrong : {std::string("room.glb"), "sha256:" + std::string(63, 'f'),
                                   "sha256:" + std::string(64, 'F'), std::string()}) {
    Spec spec = ao();
    spec.scene->blob = wrong;
    EXPECT_TRUE(has(faults(spec), "/inputs/scene type")) << wrong;
  }
  for (const char* uri :
       {"../secret.bin", "a/../../b", "/etc/passwd", "http://host/x", "", "a\\b"}) {
    Spec spec = ao();
    spec.scene->resources = {{uri, kDigest}};
    EXPECT_TRUE(has(faults(spec), "/inputs/scene/resources range")) << uri;
  }
  Spec spec = ao();
  spec.scene->resources = {{"textures/a..b.png", kDigest}};
  EXPECT_TRUE(faults(spec).empty());
}

TEST(Spec, EnvironmentMapsAreHeldToTheirRanges) {
  Spec spec = maps();
  auto& p = std::get<EnvironmentMapsParameters>(spec.parameters);
  p.sh->bands = 130;
  p.irradiance->size = 0;
  p.prefilter = PrefilterOutput{.size = 100, .levels = 1};
  p.dfg->size = 7;
  const auto all = faults(spec);
  EXPECT_EQ(all.size(), 5u);
  for (const char* one : {"/parameters/sh/bands range", "/parameters/irradiance/size range",
                          "/parameters/prefilter/size range", "/parameters/prefilter/levels range",
                          "/parameters/dfg/size range"})
    EXPECT_TRUE(has(all, one)) << one;
  p = {};
  EXPECT_TRUE(has(faults(spec), "/parameters missing"));
  p.prefilter = PrefilterOutput{.size = 8, .levels = 5};
  EXPECT_TRUE(has(faults(spec), "/parameters/prefilter/levels conflict"));
  p.prefilter = PrefilterOutput{.size = 8, .levels = 4};
  EXPECT_TRUE(faults(spec).empty());
}

TEST(Spec, ChainsNameARoughnessForEachLevelExactlyWhenCustom) {
  Spec spec = maps();
  auto& p = std::get<EnvironmentMapsParameters>(spec.parameters);
  p = {};
  p.sheen = PrefilterOutput{.levels = 2, .roughness = {0.5, 1}};
  EXPECT_TRUE(has(faults(spec), "/parameters/sheen/roughness conflict"));
  p.sheen->roughness_scale = RoughnessScale::custom;
  EXPECT_TRUE(faults(spec).empty());
  p.sheen->roughness = {0.05, 1};  // under what sheen can draw
  EXPECT_TRUE(has(faults(spec), "/parameters/sheen/roughness/0 range"));
  p.prefilter = p.sheen;
  p.sheen.reset();
  EXPECT_TRUE(faults(spec).empty());
  p.prefilter->roughness = {0, 0.5, 1.5};
  EXPECT_TRUE(has(faults(spec), "/parameters/prefilter/roughness conflict"));
  EXPECT_TRUE(has(faults(spec), "/parameters/prefilter/roughness/2 range"));
  p.prefilter->roughness.clear();
  EXPECT_TRUE(has(faults(spec), "/parameters/prefilter/roughness missing"));
}

TEST(Spec, BandsBelongToHarmonicIrradiance) {
  Spec spec = maps();
  auto& p = std::get<EnvironmentMapsParameters>(spec.parameters);
  p.irradiance = IrradianceOutput{.bands = 5};
  EXPECT_TRUE(has(faults(spec), "/parameters/irradiance/bands conflict"));
  p.irradiance->method = IrradianceMethod::harmonics;
  EXPECT_TRUE(faults(spec).empty());
  p.irradiance->bands = 34;
  EXPECT_TRUE(has(faults(spec), "/parameters/irradiance/bands range"));
}

TEST(Spec, EnvironmentMapsRefuseWhatOnlySamplingCouldUse) {
  Spec spec = maps();
  spec.accuracy.max_samples = 1024;
  spec.accuracy.max_seconds = 10;
  spec.seed = 1;
  EXPECT_EQ(faults(spec),
            (std::vector<std::string>{"/accuracy/max_samples conflict",
                                      "/accuracy/max_seconds conflict", "/seed conflict"}));
  for (const SpecFault& fault : validate(spec))
    EXPECT_NE(fault.message.find("deterministic"), std::string::npos) << fault.message;
  for (Spec sampled : {ao(), probes()}) {
    sampled.accuracy = spec.accuracy;
    sampled.seed = spec.seed;
    EXPECT_TRUE(faults(sampled).empty());
  }
}

TEST(Spec, ProbesAreHeldToTheirRanges) {
  Spec spec = probes();
  auto& p = std::get<ProbesParameters>(spec.parameters);
  p.positions = {{0, 0, 0}, {0, NAN, 0}, {0, 0, 1e19}};
  p.cubemap.size = 513;
  p.sh.bands = 0;
  p.max_bounces = 65;
  const auto all = faults(spec);
  EXPECT_EQ(all.size(), 5u);
  EXPECT_TRUE(has(all, "/parameters/positions/1 range"));
  EXPECT_TRUE(has(all, "/parameters/positions/2 range"));
  p = {};
  EXPECT_TRUE(has(faults(spec), "/parameters/positions missing"));
}

TEST(Kitchen, ChunksCoverTheElementsInOrder) {
  for (const auto& [elements, seconds] :
       {std::pair<uint64_t, double>{100, 10.0}, {3, 1e9}, {0, 5}, {7, 0}, {10, NAN}}) {
    const std::vector<ElementRange> chunks = split_chunks(elements, seconds, 1);
    ASSERT_FALSE(chunks.empty());
    uint64_t next = 0;
    for (const ElementRange& chunk : chunks) {
      EXPECT_EQ(chunk.first, next);
      next += chunk.count;
    }
    EXPECT_EQ(next, elements);
  }
  EXPECT_EQ(split_chunks(100, 10, 1).size(), 10u);
}

TEST(Kitchen, BytesComeBackAndTornOnesAreRefused) {
  ByteWriter writer;
  writer.u64(1);
  writer.f64(0.5);
  writer.f32(2);
  writer.u32(3);
  const float row[] = {4, 5};
  writer.floats(row);
  const std::vector<std::byte> bytes = writer.take();
  ByteReader reader(bytes);
  EXPECT_EQ(reader.u64(), 1u);
  EXPECT_EQ(reader.f64(), 0.5);
  EXPECT_EQ(reader.f32(), 2.0f);
  EXPECT_EQ(reader.u32(), 3u);
  float back[2];
  reader.floats(back);
  EXPECT_EQ(back[1], 5.0f);
  EXPECT_TRUE(reader.at_end());
  EXPECT_THROW(reader.u32(), Error);
}

TEST(Kitchen, AMissingBlobIsNamed) {
  try {
    blob_bytes(InputRef{kDigest, {}}, Inputs{});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::not_found);
    EXPECT_NE(std::string(error.what()).find(kDigest), std::string::npos);
  }
}

}  // namespace
}  // namespace lightkiln

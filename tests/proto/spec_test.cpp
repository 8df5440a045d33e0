#include <algorithm>

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include "proto/json.h"
#include "proto/json_value.h"
#include "proto/messages.h"
#include "proto/spec_table.h"

namespace lightkiln {
namespace {

const std::string kA = "\"sha256:" + std::string(64, 'a') + "\"";
const std::string kB = "\"sha256:" + std::string(64, 'b') + "\"";

std::string ao(const std::string& parameters, const std::string& more = "") {
  return R"({"kind":"ambient_occlusion","inputs":{"scene":)" + kA + R"(},"parameters":{)" +
         parameters + "}" + more + "}";
}

// "pointer code" of every fault, sorted.
std::vector<std::string> faults_of(const std::string& json) {
  std::vector<std::string> told;
  for (const SpecFault& fault : parse_spec(json).faults) {
    told.push_back(fault.pointer + " " + fault.code);
    EXPECT_FALSE(fault.message.empty());
  }
  std::sort(told.begin(), told.end());
  return told;
}
using Told = std::vector<std::string>;

TEST(SpecJson, TakesTheThreeExamples) {
  const auto occlusion = parse_spec(
      ao(R"("target":"vertices","max_distance":1500,"falloff":"linear","distribution":"cosine")",
         R"(,"accuracy":{"target_error":0.02})"));
  EXPECT_TRUE(occlusion.faults.empty());
  const auto& p = std::get<AmbientOcclusionParameters>(occlusion.spec.parameters);
  EXPECT_EQ(p.max_distance, 1500.0);
  EXPECT_EQ(p.falloff, Falloff::linear);
  EXPECT_EQ(occlusion.spec.accuracy.target_error, 0.02);

  const auto maps = parse_spec(R"({"kind":"environment_maps","inputs":{"environment":)" + kA +
                               R"(},"parameters":{"sh":{"bands":3},"irradiance":{"size":64},)"
                               R"("prefilter":{"size":256,"levels":5},"dfg":{"size":128}}})");
  EXPECT_TRUE(maps.faults.empty());
  EXPECT_EQ(std::get<EnvironmentMapsParameters>(maps.spec.parameters).prefilter->levels, 5);

  const auto probes = parse_spec(
      R"({"kind":"probes","inputs":{"scene":)" + kA + R"(,"environment":)" + kB +
      R"(},"parameters":{"positions":[[-278,273,-280]],"cubemap":{"size":64},"sh":{"bands":3}},)"
      R"("accuracy":{"target_error":0.05}})");
  EXPECT_TRUE(probes.faults.empty());
  EXPECT_EQ(std::get<ProbesParameters>(probes.spec.parameters).positions.at(0).z, -280);
}

TEST(SpecJson, TellsAllFaultsAtOnce) {
  EXPECT_EQ(faults_of(R"({"kind":"probes","inputs":{"scene":"room.glb","sky":1},"parameters":)"
                      R"({"positions":[[0,0,0],[1,2],[1,"x",3]],"cubemap":{"size":0},)"
                      R"("sh":{"band":3},"max_bounces":65},"accuracy":{"target_error":2,)"
                      R"("max_samples":64.5},"seed":-1,"colour":true})"),
            (Told{"/accuracy/max_samples type", "/accuracy/target_error range", "/colour unknown",
                  "/inputs/scene type", "/inputs/sky unknown", "/parameters/cubemap/size range",
                  "/parameters/max_bounces range", "/parameters/positions/1 type",
                  "/parameters/positions/2/1 type", "/parameters/sh/band unknown", "/seed range"}));
}

TEST(SpecJson, NamesWhatIsMissing) {
  EXPECT_EQ(faults_of("{}"), (Told{"/kind missing"}));
  EXPECT_EQ(faults_of(R"({"kind":"ambient_occlusion"})"), (Told{"/inputs/scene missing"}));
  EXPECT_EQ(faults_of(R"({"kind":"probes","inputs":{}})"),
            (Told{"/inputs/scene missing", "/parameters/positions missing"}));
  EXPECT_EQ(faults_of(R"({"kind":"environment_maps","inputs":{"environment":)" + kA + "}}"),
            (Told{"/parameters missing"}));
  EXPECT_EQ(faults_of("[]"), (Told{" type"}));
}

TEST(SpecJson, SuggestsTheNearestName) {
  const auto faults = parse_spec(ao(R"("max_distanc":5,"falloff":"linaer")")).faults;
  ASSERT_EQ(faults.size(), 2u);
  EXPECT_EQ(faults[0].suggestion, "max_distance");
  EXPECT_EQ(faults[1].suggestion, "linear");
  EXPECT_EQ(faults[1].allowed, "none, linear, quadratic, smooth or exponential");
  EXPECT_EQ(parse_spec(R"({"kind":"probe"})").faults.at(0).suggestion, "probes");
}

TEST(SpecJson, TellsConflictsOfCoreToo) {
  EXPECT_EQ(faults_of(ao(R"("falloff":"linear")")), (Told{"/parameters/max_distance missing"}));
  EXPECT_EQ(faults_of(ao(R"("falloff_distance":2)")),
            (Told{"/parameters/falloff_distance conflict"}));
  EXPECT_EQ(faults_of(ao(R"("falloff":"linear","colour":1)")),
            (Told{"/parameters/colour unknown", "/parameters/max_distance missing"}));
  // What may only follow from a refused value is not told.
  EXPECT_EQ(faults_of(ao(R"("falloff":"exponentail","falloff_distance":2)")),
            (Told{"/parameters/falloff range"}));
}

TEST(SpecJson, NullIsInfiniteAndNothingElseIs) {
  EXPECT_TRUE(faults_of(ao(R"("max_distance":null)")).empty());
  for (const char* value : {"0", "-1", "true", "\"infinite\"", "[]", "{}", "1e301"})
    EXPECT_FALSE(faults_of(ao(std::string("\"max_distance\":") + value)).empty()) << value;
  EXPECT_FALSE(faults_of(ao("", R"(,"seed":null)")).empty());
}

TEST(SpecJson, TakesAGltfWithItsResources) {
  const std::string json = R"({"kind":"ambient_occlusion","inputs":{"scene":{"blob":)" + kA +
                           R"(,"resources":{"z.bin":)" + kB + R"(,"a b.png":)" + kA + "}}}}";
  const auto parsed = parse_spec(json);
  ASSERT_TRUE(parsed.faults.empty());
  ASSERT_EQ(parsed.spec.scene->resources.size(), 2u);
  EXPECT_EQ(parsed.spec.scene->resources[0].first, "a b.png");
  EXPECT_EQ(input_digests(parsed.spec).size(), 2u);
  EXPECT_EQ(faults_of(R"({"kind":"ambient_occlusion","inputs":{"scene":{"blob":)" + kA +
                      R"(,"resources":{"../x":)" + kB + R"(,"y":"sha256:zz"}}}})")
                .size(),
            1u);  // the digest; core's word on the URI stands at the same place
  EXPECT_FALSE(faults_of(R"({"kind":"ambient_occlusion","inputs":{"scene":{"blob":)" + kA +
                         R"(,"resources":{"../x":)" + kB + "}}}}")
                   .empty());
}

TEST(SpecJson, TakesAnEnvironmentAsSixFaces) {
  const auto order = [](const std::string& environment) {
    return R"({"kind":"environment_maps","inputs":{"environment":)" + environment +
           R"(},"parameters":{"sh":{}}})";
  };
  const std::string five =
      "\"nz\":" + kB + ",\"pz\":" + kA + ",\"ny\":" + kA + ",\"py\":" + kA + ",\"nx\":" + kA;
  const std::string six = order("{\"faces\":{" + five + ",\"px\":" + kA + "}}");
  const auto parsed = parse_spec(six);
  ASSERT_TRUE(parsed.faults.empty()) << parsed.faults[0].message;
  ASSERT_EQ(parsed.spec.environment->faces.size(), 6u);
  EXPECT_EQ("\"" + parsed.spec.environment->faces[5] + "\"", kB);
  EXPECT_EQ(input_digests(parsed.spec).size(), 2u);
  const std::string canonical = canonical_spec(parsed.spec);
  EXPECT_EQ(canonical_spec(parse_spec(canonical).spec), canonical);

  const auto told = [&](const std::string& environment) { return faults_of(order(environment)); };
  EXPECT_EQ(told("{\"faces\":{" + five + "}}"), Told{"/inputs/environment/faces/px missing"});
  EXPECT_EQ(told("{\"faces\":{" + five + ",\"px\":" + kA + ",\"up\":" + kA + "}}"),
            Told{"/inputs/environment/faces/up unknown"});
  EXPECT_EQ(told("{\"faces\":[]}"), Told{"/inputs/environment/faces type"});
  EXPECT_EQ(told("{\"blob\":" + kA + ",\"faces\":{" + five + ",\"px\":" + kA + "}}"),
            Told{"/inputs/environment/blob conflict"});
  EXPECT_EQ(told("{\"blob\":" + kA + ",\"resources\":{}}"),
            Told{"/inputs/environment/resources unknown"});
}

TEST(SpecJson, TakesHowCubesAreWritten) {
  const auto order = [](const std::string& parameters) {
    return R"({"kind":"environment_maps","inputs":{"environment":)" + kA + R"(},"parameters":{)" +
           parameters + "}}";
  };
  const auto parsed = parse_spec(order(R"("irradiance":{},"cubes":{"face_orientation":"opengl"})"));
  ASSERT_TRUE(parsed.faults.empty()) << parsed.faults[0].message;
  EXPECT_EQ(std::get<EnvironmentMapsParameters>(parsed.spec.parameters).cubes.face_orientation,
            FaceOrientation::opengl);
  const std::string canonical = canonical_spec(parsed.spec);
  EXPECT_NE(canonical.find(R"("cubes":{"face_orientation":"opengl"})"), std::string::npos);
  EXPECT_EQ(canonical_spec(parse_spec(canonical).spec), canonical);
  // The default is the same order as none, under the same digest as ever.
  const std::string plain = canonical_spec(parse_spec(order(R"("irradiance":{})")).spec);
  for (const char* cubes : {"{}", R"({"face_orientation":"openexr"})"})
    EXPECT_EQ(
        canonical_spec(parse_spec(order(std::string(R"("irradiance":{},"cubes":)") + cubes)).spec),
        plain);
  EXPECT_EQ(plain.find("cubes"), std::string::npos);

  const auto told = [&](const std::string& parameters) { return faults_of(order(parameters)); };
  EXPECT_EQ(told(R"("sh":{},"cubes":{"face_orientation":"opengl"})"),
            Told{"/parameters/cubes/face_orientation conflict"});
  EXPECT_EQ(told(R"("irradiance":{},"cubes":{"face_orientation":"vulkan"})"),
            Told{"/parameters/cubes/face_orientation range"});
  EXPECT_EQ(told(R"("irradiance":{},"cubes":{"orientation":"opengl"})"),
            Told{"/parameters/cubes/orientation unknown"});
  EXPECT_EQ(told(R"("irradiance":{},"cubes":"opengl")"), Told{"/parameters/cubes type"});

  const auto probes = parse_spec(
      R"({"kind":"probes","inputs":{"scene":)" + kA +
      R"(},"parameters":{"positions":[[0,0,0]],"cubes":{"face_orientation":"opengl"}}})");
  ASSERT_TRUE(probes.faults.empty()) << probes.faults[0].message;
  EXPECT_EQ(std::get<ProbesParameters>(probes.spec.parameters).cubes.face_orientation,
            FaceOrientation::opengl);
  EXPECT_EQ(canonical_spec(parse_spec(canonical_spec(probes.spec)).spec),
            canonical_spec(probes.spec));
}

TEST(SpecJson, TakesTheSameWindowsForProbesAndAssets) {
  const auto probes = [](const std::string& sh) {
    return R"({"kind":"probes","inputs":{"scene":)" + kA +
           R"(},"parameters":{"positions":[[0,0,0]],"sh":{)" + sh + "}}}";
  };
  const auto asset = [](const std::string& members) {
    return R"({"kind":"environment_maps","inputs":{"environment":)" + kA +
           R"(},"parameters":{"asset":{)" + members + "}}}";
  };
  const auto windowed = parse_spec(probes(R"("window":"lanczos","window_quantity":"radiance")"));
  ASSERT_TRUE(windowed.faults.empty()) << windowed.faults[0].message;
  const auto& sh = std::get<ProbesParameters>(windowed.spec.parameters).sh;
  EXPECT_EQ(sh.window, ShWindow::lanczos);
  EXPECT_EQ(sh.window_quantity, ShQuantity::radiance);
  const auto light = parse_spec(asset(R"("window":"minimal")"));
  ASSERT_TRUE(light.faults.empty()) << light.faults[0].message;
  EXPECT_EQ(std::get<EnvironmentMapsParameters>(light.spec.parameters).asset->window,
            ShWindow::minimal);
  for (const Spec& spec : {windowed.spec, light.spec}) {
    const std::string canonical = canonical_spec(spec);
    EXPECT_EQ(canonical_spec(parse_spec(canonical).spec), canonical);
  }
  EXPECT_EQ(faults_of(probes(R"("window_quantity":"radiance")")),
            Told{"/parameters/sh/window_quantity conflict"});
  EXPECT_EQ(faults_of(probes(R"("window":"hamming")")), Told{"/parameters/sh/window range"});
  EXPECT_EQ(faults_of(asset(R"("window":true)")), Told{"/parameters/asset/window type"});
  EXPECT_EQ(faults_of(asset(R"("window_quantity":"radiance")")),
            Told{"/parameters/asset/window_quantity unknown"});
}

TEST(SpecCanonical, IsStableUnderOrderSpaceAndDefaults) {
  const std::string plain = ao("");
  const std::string spelled =
      " { \"seed\" : 0 , \"accuracy\":{\"max_seconds\":null,\"target_error\":2.0e-2,"
      "\"max_samples\":65536},\"parameters\":{\"falloff\":\"none\",\"max_distance\":null},"
      "\"inputs\":{\"scene\":{\"blob\":" +
      kA + ",\"resources\":{}}},\"kind\":\"ambient_occlusion\"}";
  ASSERT_TRUE(faults_of(spelled).empty());
  const std::string canonical = canonical_spec(parse_spec(plain).spec);
  EXPECT_EQ(canonical_spec(parse_spec(spelled).spec), canonical);
  EXPECT_EQ(canonical,
            R"({"accuracy":{"max_samples":65536,"max_seconds":null,"target_error":0.02},)"
            R"("inputs":{"scene":)" +
                kA +
                R"(},"kind":"ambient_occlusion","parameters":{"distribution":"cosine",)"
                R"("falloff":"none","falloff_distance":null,"max_distance":null,)"
                R"("target":"vertices"},"seed":0})");
  // Known bytes: a digest that changes breaks every stored result.
  EXPECT_EQ(spec_digest("{}"),
            sha256_digest((std::string("lightkiln ") + kEngineVersion + "\n{}").data(),
                          std::string(kEngineVersion).size() + 13));
}

TEST(SpecCanonical, EnvironmentMapsHaveNoSamplesNoSeedAndNoTimeLimit) {
  const auto maps = [](const std::string& more) {
    return R"({"kind":"environment_maps","inputs":{"environment":)" + kA +
           R"(},"parameters":{"sh":{}})" + more + "}";
  };
  const std::string canonical = canonical_spec(parse_spec(maps("")).spec);
  EXPECT_EQ(canonical,
            R"({"accuracy":{"check_texels":4,"target_error":0.001},"inputs":{"environment":)" + kA +
                R"(},"kind":"environment_maps","parameters":{"sh":{"bands":3,"exports":[],)" +
                R"("window":"none","window_quantity":"irradiance","zh3":false}}})");
  EXPECT_TRUE(faults_of(canonical).empty());
  EXPECT_EQ(
      faults_of(maps(R"(,"accuracy":{"max_samples":64,"max_seconds":1},"seed":2)")),
      (Told{"/accuracy/max_samples conflict", "/accuracy/max_seconds conflict", "/seed conflict"}));
  // What means "none" orders nothing, and so is the same order.
  const std::string none = maps(R"(,"accuracy":{"max_samples":null,"max_seconds":null},"seed":0)");
  EXPECT_TRUE(faults_of(none).empty());
  EXPECT_EQ(canonical_spec(parse_spec(none).spec), canonical);
}

TEST(SpecCanonical, OnlyDeterministicKindsAreCheckedAgainstATwin) {
  EXPECT_EQ(faults_of(ao("", R"(,"accuracy":{"check_texels":5})")),
            (Told{"/accuracy/check_texels conflict"}));
  EXPECT_EQ(canonical_spec(parse_spec(ao("")).spec).find("check_texels"), std::string::npos);
}

TEST(SpecCanonical, TellsOrdersApart) {
  const std::string base = canonical_spec(parse_spec(ao("")).spec);
  for (const char* parameters : {R"("max_distance":1)", R"("distribution":"uniform")",
                                 R"("max_distance":1.0000000000000002)"})
    EXPECT_NE(canonical_spec(parse_spec(ao(parameters)).spec), base);
  EXPECT_NE(canonical_spec(parse_spec(ao("", R"(,"seed":18446744073709551615)")).spec), base);
  const auto probe = [](const std::string& x) {
    return canonical_spec(parse_spec(R"({"kind":"probes","inputs":{"scene":)" + kA +
                                     R"(},"parameters":{"positions":[[)" + x + ",0,0]]}}")
                              .spec);
  };
  EXPECT_EQ(probe("0"), probe("-0.0"));
  EXPECT_NE(probe("0"), probe("5e-324"));
}

// Any spec within its ranges.
Spec random_spec() {
  const auto positive = [] {
    return std::abs(*rc::gen::suchThat(rc::gen::arbitrary<double>(),
                                       [](double x) { return x != 0 && std::abs(x) < 1e18; }));
  };
  const auto digest = [] {
    return "sha256:" + *rc::gen::container<std::string>(
                           64, rc::gen::elementOf(std::string("0123456789abcdef")));
  };
  Spec spec =
      empty_spec(*rc::gen::elementOf(std::vector<Kind>(std::begin(kKinds), std::end(kKinds))));
  if (spec.kind() != Kind::environment_maps) {
    spec.scene = InputRef{digest(), {}};
    if (*rc::gen::arbitrary<bool>())
      spec.scene->resources = {{"a.bin", digest()}, {"b/c.png", digest()}};
  }
  if (spec.kind() == Kind::environment_maps) spec.environment = InputRef{digest(), {}};
  if (spec.environment && *rc::gen::arbitrary<bool>()) {
    spec.environment->blob.clear();
    for (int face = 0; face < 6; ++face) spec.environment->faces.push_back(digest());
  }
  if (*rc::gen::arbitrary<bool>()) spec.accuracy.target_error = *rc::gen::inRange(1, 1000) / 1000.0;
  if (spec.kind() != Kind::environment_maps) {
    spec.seed = *rc::gen::arbitrary<uint64_t>();
    if (*rc::gen::arbitrary<bool>())
      spec.accuracy.max_samples = *rc::gen::inRange<uint64_t>(64, 1048577);
    if (*rc::gen::arbitrary<bool>()) spec.accuracy.max_seconds = positive();
  }
  if (auto* p = std::get_if<AmbientOcclusionParameters>(&spec.parameters)) {
    p->falloff = Falloff(*rc::gen::inRange(0, 5));
    p->distribution = Distribution(*rc::gen::inRange(0, 2));
    if (p->falloff == Falloff::exponential) p->falloff_distance = positive();
    if (*rc::gen::arbitrary<bool>() ||
        (p->falloff != Falloff::none && p->falloff != Falloff::exponential))
      p->max_distance = positive();
  } else if (auto* maps = std::get_if<EnvironmentMapsParameters>(&spec.parameters)) {
    maps->sh = ShOutput{*rc::gen::inRange(1, 130)};
    maps->sh->window = ShWindow(*rc::gen::inRange(0, 4));
    if (maps->sh->window != ShWindow::none && *rc::gen::arbitrary<bool>())
      maps->sh->window_quantity = ShQuantity::radiance;
    maps->sh->zh3 = *rc::gen::arbitrary<bool>();
    maps->sh->exports = *rc::gen::inRange(0u, 128u);
    if (*rc::gen::arbitrary<bool>()) maps->spectrum = SpectrumOutput{*rc::gen::inRange(1, 130)};
    if (*rc::gen::arbitrary<bool>()) maps->dfg = DfgOutput{.size = *rc::gen::inRange(8, 1025)};
    if (*rc::gen::arbitrary<bool>())
      maps->prefilter = PrefilterOutput{.size = 1 << *rc::gen::inRange(3, 12), .levels = 4};
    if (*rc::gen::arbitrary<bool>()) {
      maps->sheen = PrefilterOutput{.levels = 2, .roughness_scale = RoughnessScale::custom};
      maps->sheen->roughness = {*rc::gen::inRange(10, 101) / 100.0, 1};
      maps->sheen->packaging = Packaging(*rc::gen::inRange(0, 2));
    }
    if (*rc::gen::arbitrary<bool>())
      maps->irradiance = IrradianceOutput{.method = IrradianceMethod::harmonics,
                                          .bands = *rc::gen::inRange(1, 34)};
    if (*rc::gen::arbitrary<bool>())
      maps->asset = AssetOutput{.window = ShWindow(*rc::gen::inRange(0, 4))};
    if (maps->irradiance || maps->sheen)
      maps->cubes.face_orientation = FaceOrientation(*rc::gen::inRange(0, 2));
  } else {
    auto& probes = std::get<ProbesParameters>(spec.parameters);
    const int count = *rc::gen::inRange(1, 5);
    for (int i = 0; i < count; ++i)
      probes.positions.push_back({positive(), -positive(), positive()});
    if (*rc::gen::arbitrary<bool>()) probes.max_bounces = *rc::gen::inRange(0, 65);
    probes.sh.window = ShWindow(*rc::gen::inRange(0, 4));
    probes.cubes.face_orientation = FaceOrientation(*rc::gen::inRange(0, 2));
  }
  return spec;
}

TEST(SpecCanonical, ReadsBackToItself) {
  EXPECT_TRUE(rc::check([] {
    const Spec spec = random_spec();
    RC_PRE(validate(spec).empty());
    const std::string canonical = canonical_spec(spec);
    const ParsedSpec again = parse_spec(canonical);
    RC_ASSERT(again.faults.empty());
    RC_ASSERT(canonical_spec(again.spec) == canonical);
    RC_ASSERT(spec_digest(canonical) == spec_digest(canonical_spec(again.spec)));
  }));
}

// Rows and core's validate() draw the same border: just inside is taken by both, just outside
// refused by both.
TEST(SpecTable, RangesAreThoseOfValidate) {
  int borders = 0;
  for (const Kind kind : kKinds) {
    for (const ParameterGroup& group : kind_table(kind).groups) {
      for (const ParameterRow& row : group.rows) {
        Spec spec = empty_spec(kind);
        if (group.create) group.create(spec);
        auto* member = std::get_if<int& (*)(Spec&)>(&row.member);
        if (!member || row.refused) continue;
        const std::string pointer = std::string(group.path) + "/" + std::string(row.name);
        const auto refused = [&](int value) {
          (*member)(spec) = value;
          const auto faults = validate(spec);
          return std::any_of(faults.begin(), faults.end(),
                             [&](const SpecFault& f) { return f.pointer == pointer; });
        };
        const int low = static_cast<int>(row.range.minimum);
        const int high = static_cast<int>(row.range.maximum);
        EXPECT_TRUE(refused(low - 1)) << pointer;
        EXPECT_FALSE(refused(low)) << pointer;
        EXPECT_TRUE(refused(high + 1)) << pointer;
        if (row.name != "levels") {  // its top also depends on the size
          EXPECT_FALSE(refused(high)) << pointer;
        }
        ++borders;
      }
    }
  }
  EXPECT_GE(borders, 8);
}

TEST(JobRequest, PrefixesPointersAndChecksEnvelope) {
  const auto parsed = parse_job_request(
      R"({"spec":{"kind":"ambient_occlusion","inputs":{"scene":1}},"name":"a\nb","labels":{"x y":"1","k":2},)"
      R"("priority":101,"prority":1})");
  Told told;
  for (const SpecFault& fault : parsed.faults) told.push_back(fault.pointer + " " + fault.code);
  std::sort(told.begin(), told.end());
  EXPECT_EQ(told, (Told{"/labels/k type", "/labels/x y range", "/name range", "/priority range",
                        "/prority unknown", "/spec/inputs/scene type"}));
  EXPECT_EQ(parse_job_request("{}").faults.at(0).pointer, "/spec");
  EXPECT_EQ(parse_job_request("{").faults.at(0).code, "syntax");
}

TEST(JobRequest, IsReadAsItIsWritten) {
  const std::string text =
      write_job_request(ao(R"("max_distance":2)"), "a name", {{"k", "v w"}}, -3);
  const auto parsed = parse_job_request(text);
  ASSERT_TRUE(parsed.faults.empty());
  EXPECT_EQ(parsed.request.name, "a name");
  EXPECT_EQ(parsed.request.labels.at("k"), "v w");
  EXPECT_EQ(parsed.request.priority, -3);
  EXPECT_EQ(parsed.request.spec_digest, spec_digest(parsed.request.canonical));
}

TEST(Digests, AreParsedStrictly) {
  const auto good = parse_digests("{\"digests\":[" + kA + "," + kB + "]}");
  EXPECT_TRUE(good.faults.empty());
  EXPECT_EQ(good.digests.size(), 2u);
  EXPECT_EQ(parse_digests("{\"digests\":[\"sha256:x\"," + kA + ",1]}").faults.size(), 2u);
  EXPECT_FALSE(parse_digests("{}").faults.empty());
  EXPECT_FALSE(parse_digests("[]").faults.empty());
  EXPECT_FALSE(is_digest("sha256:" + std::string(64, 'A')));
  EXPECT_FALSE(is_digest("sha256:" + std::string(63, 'a')));
}

TEST(Sha256, MatchesThePublishedExamples) {
  // FIPS 180-4 examples.
  EXPECT_EQ(sha256_digest("abc", 3),
            "sha256:ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_digest("", 0),
            "sha256:e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(repr_digest(sha256_digest("", 0)),
            "sha-256=:47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=:");
}

}  // namespace
}  // namespace lightkiln

#include <cmath>

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include "proto/json.h"
#include "proto/json_value.h"
#include "proto/json_writer.h"
#include "proto/messages.h"
#include "proto/problem.h"
#include "proto/spec_table.h"

namespace lightkiln {
namespace {

double finite() {
  return *rc::gen::map(rc::gen::arbitrary<uint64_t>(), [](uint64_t bits) {
    const double number = std::bit_cast<double>(bits);
    return std::isfinite(number) ? number : 0.25;
  });
}
uint64_t whole() {
  return *rc::gen::arbitrary<uint64_t>();
}

Plan random_plan() {
  Plan plan;
  plan.kind = kKinds[*rc::gen::inRange(0, 3)];
  plan.isa = "avx";
  const int count = *rc::gen::inRange(0, 6);
  for (int i = 0; i < count; ++i) {
    plan.effects.push_back({"sun", *rc::gen::arbitrary<bool>(), "a \"reason\"\n", finite()});
    plan.warnings.push_back("w\xC3\xA4rning");
    plan.repairs.emplace_back("NaN vertices", whole());
    plan.chunks.push_back({whole(), whole()});
    plan.prices.push_back({finite(), whole(), finite(), *rc::gen::arbitrary<bool>()});
  }
  plan.elements = whole();
  plan.element_unit = "vertex";
  plan.min_samples = whole();
  plan.max_samples = whole();
  plan.max_bounces = *rc::gen::arbitrary<int>();
  plan.reference_luminance = finite();
  plan.predicted_s = finite();
  plan.pilot_s = finite();
  return plan;
}

bool same(double a, double b) {
  return std::bit_cast<uint64_t>(a) == std::bit_cast<uint64_t>(b);
}

TEST(PlanJson, RoundTripsToTheLastBit) {
  EXPECT_TRUE(rc::check([] {
    const Plan plan = random_plan();
    const std::string text = write_plan(plan);
    const Plan back = read_plan(text);
    RC_ASSERT(write_plan(back) == text);
    RC_ASSERT(back.kind == plan.kind);
    RC_ASSERT(back.effects.size() == plan.effects.size());
    for (size_t i = 0; i < plan.effects.size(); ++i) {
      RC_ASSERT(same(back.effects[i].bound, plan.effects[i].bound));
      RC_ASSERT(back.effects[i].active == plan.effects[i].active);
      RC_ASSERT(back.effects[i].reason == plan.effects[i].reason);
      RC_ASSERT(back.repairs[i] == plan.repairs[i]);
      RC_ASSERT(back.chunks[i].first == plan.chunks[i].first);
      RC_ASSERT(back.chunks[i].count == plan.chunks[i].count);
      RC_ASSERT(same(back.prices[i].seconds, plan.prices[i].seconds));
      RC_ASSERT(back.prices[i].samples == plan.prices[i].samples);
    }
    RC_ASSERT(same(back.reference_luminance, plan.reference_luminance));
    RC_ASSERT(back.max_bounces == plan.max_bounces);
    RC_ASSERT(back.max_samples == plan.max_samples);
    RC_ASSERT(same(back.predicted_s, plan.predicted_s));
  }));
}

TEST(PlanJson, RefusesADocumentOfAnotherShape) {
  const std::string good = write_plan(Plan{});
  EXPECT_NO_THROW(read_plan(good));
  for (const std::string bad : {"", "{}", "[]", "null"}) EXPECT_THROW(read_plan(bad), Error) << bad;
  std::string typed = good;
  typed.replace(typed.find("\"elements\":0"), 12, "\"elements\":-1");
  EXPECT_THROW(read_plan(typed), Error);
}

TEST(ChunkReportJson, RoundTripsToTheLastBit) {
  EXPECT_TRUE(rc::check([] {
    ChunkReport report;
    report.elements = whole();
    const int count = *rc::gen::inRange(0, 5);
    for (int i = 0; i < count; ++i)
      report.rounds.push_back(
          {whole(), whole(), whole(), finite(), finite(), finite(), finite(), whole()});
    report.counters.shadow_rays = whole();
    report.counters.environment_reads = whole();
    report.counters.projected_texels = whole();
    report.counters.cube_texels = whole();
    report.cpu_s = finite();
    report.suspicious = whole();
    const ChunkReport back = read_chunk_report(write_chunk_report(report));
    RC_ASSERT(write_chunk_report(back) == write_chunk_report(report));
    RC_ASSERT(back.counters.shadow_rays == report.counters.shadow_rays);
    for (size_t i = 0; i < report.rounds.size(); ++i)
      RC_ASSERT(same(back.rounds[i].error_sum_sq, report.rounds[i].error_sum_sq));
  }));
}

TEST(AccuracyJson, GivesRmsOverAllElements) {
  AccuracyRecord record;
  record.elements = 4;
  record.rounds.push_back({64, 256, 4, 0.5, 0.25, 0.16, 0.3, 1});
  const JsonValue json = read_trusted_json(write_accuracy(record), ErrorCode::internal, "x");
  EXPECT_DOUBLE_EQ(json.find("rounds")->array()->at(0).find("error_rms")->number(), 0.2);
}

TEST(DocumentJson, CarriesConventionAndSelftest) {
  Spec spec;
  spec.environment = InputRef{sha256_digest("x", 1), {}};
  EnvironmentMapsParameters parameters;
  parameters.sh = ShOutput{1};
  spec.parameters = parameters;
  Plan plan;
  plan.kind = Kind::environment_maps;
  EnvironmentDocument document;
  ShDocument sh;
  sh.sh = ShRgb(1);
  sh.sh.coefficients[0] = {1, 2, 3};
  sh.selftest.push_back({{0, 0, 1}, {0.5, 1, 1.5}, {2, 4, 6}});
  document.sh = sh;
  Assembly assembly;
  assembly.document = document;
  assembly.artifacts.push_back({"dfg.exr", "image", "image/x-exr", {std::byte{7}}});
  const JsonValue json =
      read_trusted_json(write_document(assembly, spec, plan), ErrorCode::internal, "x");
  const JsonValue* convention = json.find("convention");
  ASSERT_NE(convention, nullptr);
  for (const char* key : {"basis", "condon_shortley", "index", "quantity", "handedness", "up",
                          "units", "colour_space"})
    EXPECT_NE(convention->find(key), nullptr) << key;
  EXPECT_FALSE(*convention->find("condon_shortley")->boolean());
  EXPECT_EQ(json.find("sh")->find("coefficients")->array()->at(0).array()->at(2).number(), 3);
  EXPECT_EQ(json.find("sh")->find("selftest")->array()->size(), 1u);
  EXPECT_TRUE(json.find("dfg")->is_null());
  EXPECT_EQ(*json.find("artifacts")->array()->at(0).find("digest")->string(),
            sha256_digest("\x07", 1));
}

TEST(DocumentJson, SaysOfEveryCubeHowItsFacesAreTurned) {
  Spec spec;
  spec.environment = InputRef{sha256_digest("x", 1), {}};
  spec.parameters = EnvironmentMapsParameters{};
  Plan plan;
  plan.kind = Kind::environment_maps;
  const auto write = [&](FaceOrientation faces) {
    EnvironmentDocument document;
    document.faces = faces;
    document.irradiance.emplace().faces = faces;
    document.prefilter.emplace_back().faces = faces;
    document.dfg.emplace();
    LayoutDocument strip;
    strip.name = "cube_strip";
    strip.artifacts = {"layout_cube_strip.exr"};
    strip.layout = make_layout(LayoutKind::cube_strip, 8);
    strip.faces = faces;
    document.layouts.push_back(strip);
    Assembly assembly;
    assembly.document = document;
    return read_trusted_json(write_document(assembly, spec, plan), ErrorCode::internal, "x");
  };
  const JsonValue theirs = write(FaceOrientation::opengl), ours = write(FaceOrientation::openexr);
  const auto cubes = [](const JsonValue& json) {
    return std::vector{json.find("convention"), json.find("irradiance"),
                       &json.find("prefilter")->array()->at(0),
                       &json.find("layouts")->array()->at(0)};
  };
  for (const JsonValue* cube : cubes(theirs)) {
    ASSERT_NE(cube->find("face_orientation"), nullptr);
    EXPECT_EQ(*cube->find("face_orientation")->string(), "opengl");
  }
  for (const JsonValue* cube : cubes(ours)) EXPECT_EQ(cube->find("face_orientation"), nullptr);
  EXPECT_EQ(theirs.find("dfg")->find("face_orientation"), nullptr);
  EXPECT_NE(theirs.find("convention")->find("cube")->string()->find("(-x, y, z)"),
            std::string::npos);
}

TEST(DocumentJson, SaysOfEveryWindowTheSame) {
  ShWindowReport report;
  report.window = ShWindow::minimal;
  report.lambda = 0.25;
  report.factors = {1, 0.5};
  report.energy_removed = 0.125;
  report.contrast_removed = 0.0625;
  const auto written = [](auto document, const Spec& spec) {
    Assembly assembly;
    assembly.document = document;
    return read_trusted_json(write_document(assembly, spec, Plan{}), ErrorCode::internal, "x");
  };
  Spec maps;
  maps.environment = InputRef{sha256_digest("x", 1), {}};
  maps.parameters = EnvironmentMapsParameters{};
  EnvironmentDocument environment;
  environment.sh_window = report;
  environment.asset.emplace().sh_window = report;
  const JsonValue map = written(environment, maps);
  ProbesDocument probes;
  probes.probes.emplace_back().sh_window = report;
  probes.probes.emplace_back();
  const JsonValue probe = written(probes, empty_spec(Kind::probes));
  const JsonValue::Array& items = *probe.find("probes")->array();
  const auto text = [](const JsonValue* value) {
    JsonWriter writer;
    writer.value(*value, true);
    return writer.take();
  };
  const std::string stated = text(map.find("sh_window"));
  EXPECT_NE(stated.find("\"energy_removed\":0.125"), std::string::npos);
  EXPECT_NE(stated.find("\"contrast_removed\":0.0625"), std::string::npos);
  EXPECT_EQ(text(map.find("asset")->find("sh_window")), stated);
  EXPECT_EQ(text(items.at(0).find("sh_window")), stated);
  EXPECT_TRUE(items.at(1).find("sh_window")->is_null());
}

TEST(DocumentJson, CountsTheVerticesThatFellShort) {
  AoDocument document;
  document.vertices = 9;
  document.suspicious = 2;
  document.budget_limited = 5;
  AoMeshIndex mesh;
  mesh.name = "floor";
  mesh.count = 9;
  mesh.suspicious = 2;
  mesh.budget_limited = 5;
  document.meshes.push_back(mesh);
  Assembly assembly;
  assembly.document = document;
  const JsonValue json =
      read_trusted_json(write_document(assembly, empty_spec(Kind::ambient_occlusion), Plan{}),
                        ErrorCode::internal, "x");
  for (const JsonValue* counts : {json.find("statistics"), &json.find("meshes")->array()->at(0)}) {
    EXPECT_EQ(counts->find("suspicious")->number(), 2);
    EXPECT_EQ(counts->find("budget_limited")->number(), 5);
  }
}

JobMessage full_job() {
  JobMessage job;
  job.id = "01J0000000000000000000000A";
  job.name = "room";
  job.kind = "ambient_occlusion";
  job.state = "running";
  job.stage = "bake";
  job.reason = "1 chunk of 4 is done.";
  job.spec_json = R"({"kind":"ambient_occlusion"})";
  job.spec_digest = sha256_digest("s", 1);
  job.labels = {{"shot", "12/a"}};
  job.priority = 5;
  job.progress = {1, 4, "chunk", 0.3125, 12.5};
  job.quality = {0.0123, 0.02, "95 % half-width"};
  job.predicted_s = 17.25;
  job.attempts = 1;
  job.error = JobErrorMessage{"oven_crashed", "It died.", "/meshes/0"};
  job.created_ms = 1767225600123;
  job.artifacts.push_back({"ao.glb", "glb", "model/gltf-binary", 77, sha256_digest("a", 1)});
  job.plan_json = R"({"kind":"ambient_occlusion"})";
  return job;
}

TEST(JobJson, RoundTrips) {
  const JobMessage job = full_job();
  const std::string text = write_job(job);
  const JobMessage back = read_job(text);
  EXPECT_EQ(write_job(back), text);
  EXPECT_EQ(back.progress.eta_s, 12.5);
  EXPECT_EQ(back.created_ms, job.created_ms);
  EXPECT_EQ(back.started_ms, 0);
  EXPECT_EQ(back.error->pointer, "/meshes/0");
  EXPECT_EQ(back.artifacts.at(0).bytes, 77u);
  const JsonValue json = read_trusted_json(text, ErrorCode::internal, "x");
  EXPECT_EQ(*json.find("links")->find("cancel")->string(),
            "/v1/jobs/01J0000000000000000000000A:cancel");
  EXPECT_TRUE(json.find("started_at")->is_null());
  EXPECT_EQ(*json.find("created_at")->string(), "2026-01-01T00:00:00.123Z");
}

TEST(JobJson, RefusesAnAnswerOfAnotherService) {
  for (const char* text : {"{}", "<html>", "[]", R"({"id":3})"}) {
    try {
      read_job(text);
      FAIL() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::unavailable);
    }
  }
}

TEST(PagesJson, RoundTrip) {
  JobPage page{{full_job(), full_job()}, "01J"};
  EXPECT_EQ(write_job_page(read_job_page(write_job_page(page))), write_job_page(page));
  page.next.clear();
  EXPECT_EQ(read_job_page(write_job_page(page)).next, "");
  const EventPage events =
      read_event_page(write_event_page({{8, "j", "log", 1000, "{\"a\":1}"}}, 3));
  EXPECT_EQ(events.next_after, 8u);
  EXPECT_EQ(events.items.at(0).data_json, "{\"a\":1}");
  EXPECT_EQ(read_event_page(write_event_page({}, 3)).next_after, 3u);
  EXPECT_EQ(read_missing(write_missing({"a", "b"})).size(), 2u);
  EXPECT_EQ(read_version(write_version({})).name, "lightkiln");
  const ValidationMessage validation{"{\"a\":1}", "sha256:x", {"m"}};
  EXPECT_EQ(write_validation(read_validation(write_validation(validation))),
            write_validation(validation));
}

TEST(TimeText, RoundTripsAndRefuses) {
  EXPECT_TRUE(rc::check([] {
    const int64_t ms = *rc::gen::inRange<int64_t>(0, 4102444800000);
    RC_ASSERT(parse_time(format_time(ms)) == ms);
  }));
  for (const char* text : {"", "2026-01-01", "2026-13-01T00:00:00.000Z", "2026-02-30T00:00:00.000Z",
                           "2026-01-01T00:00:00.00xZ", "2026-01-01T00:00:00.000+"})
    EXPECT_THROW(parse_time(text), Error) << text;
}

TEST(Hrefs, EscapeWhatIsNotPlain) {
  EXPECT_EQ(artifact_href("a/b", "x y.exr"), "/v1/jobs/a%2Fb/artifacts/x%20y.exr");
}

TEST(Problem, TableHasEveryErrorCodeOnceWithAStatus) {
  for (int i = 0; i <= static_cast<int>(ErrorCode::internal); ++i) {
    const auto code = static_cast<ErrorCode>(i);
    const ProblemKind& kind = problem_kind(code);
    EXPECT_STREQ(kind.code, error_code_name(code));
    EXPECT_EQ(kind.error, code);
  }
  for (const ProblemKind& kind : problem_kinds()) {
    EXPECT_EQ(find_problem_kind(kind.code), &kind) << kind.code << " stands twice";
    EXPECT_GE(kind.status, 400);
    EXPECT_LE(kind.status, 599);
    EXPECT_GT(std::string(kind.title).size(), 3u);
    EXPECT_GT(std::string(kind.meaning).size(), 10u);
  }
  for (const int status : {400, 401, 403, 404, 405, 408, 409, 411, 413, 414, 415,
                           416, 417, 421, 422, 429, 431, 500, 503, 505, 507}) {
    bool found = false;
    for (const ProblemKind& kind : problem_kinds()) found = found || kind.status == status;
    EXPECT_TRUE(found) << status;
  }
}

TEST(Problem, RoundTripsWithEveryFault) {
  Problem problem = make_problem("invalid_spec", "Two faults.", "urn:request:7");
  problem.errors.push_back({"/spec/seed", "range", "No.", "0 to 9", ""});
  problem.errors.push_back({"/spec/sed", "unknown", "No.", "", "seed"});
  const std::string text = write_problem(problem);
  EXPECT_EQ(write_problem(read_problem(text)), text);
  const JsonValue json = read_trusted_json(text, ErrorCode::internal, "x");
  EXPECT_EQ(*json.find("type")->string(), "/problems/invalid_spec");
  EXPECT_EQ(json.find("errors")->array()->at(0).find("suggestion"), nullptr);
}

TEST(Problem, NeverTellsInternalDetail) {
  const Problem problem = problem_from_error(Error(ErrorCode::internal, "/secret/path is broken"));
  EXPECT_EQ(write_problem(problem).find("secret"), std::string::npos);
  EXPECT_EQ(problem.status, 500);
  const Problem other =
      problem_from_error(Error(ErrorCode::not_found, "No job x.", "/spec/inputs/scene"));
  EXPECT_EQ(other.status, 404);
  EXPECT_EQ(other.errors.at(0).pointer, "/spec/inputs/scene");
}

TEST(Problem, StatusOfFaultsFollowsTheirKind) {
  EXPECT_EQ(problem_from_faults({{"", "syntax", "No."}}).status, 400);
  EXPECT_EQ(problem_from_faults({{"/a/b", "too_large", "No."}}).status, 413);
  EXPECT_EQ(problem_from_faults({{"/a", "range", "No."}, {"/b", "type", "No."}}).status, 422);
  EXPECT_EQ(problem_from_faults({{"/a", "duplicate", "No."}}).status, 422);
}

}  // namespace
}  // namespace lightkiln

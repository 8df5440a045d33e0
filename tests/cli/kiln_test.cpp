// kiln against a scripted server: every exit code, and what a hostile or weak server may send.

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "proto/client.h"
#include "proto/digest.h"
#include "proto/order.h"
#include "server/cli/commands/commands.h"
#include "server/cli/commands/text.h"
#include "tests/cli/scripted_server.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;
using test::http_answer;
using test::ScriptedRequest;
using test::ScriptedServer;

struct Outcome {
  int code = -1;
  std::string out, err;
};

Outcome kiln(std::vector<std::string> words) {
  unsetenv("LIGHTKILN_SERVER");
  unsetenv("LIGHTKILN_TOKEN_FILE");
  words.insert(words.begin(), "kiln");
  std::vector<const char*> pointers;
  for (const std::string& word : words) pointers.push_back(word.c_str());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.code = cli::run(static_cast<int>(pointers.size()), pointers.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

JobMessage job_in(const std::string& state) {
  JobMessage job;
  job.id = "01JOB";
  job.kind = "ambient_occlusion";
  job.state = state;
  job.terminal = state != "queued" && state != "running";
  job.stage = "done";
  job.spec_json = "{}";
  job.quality = {0.03, 0.02, "unit"};
  job.created_ms = 1;
  if (state == "failed")
    job.error = JobErrorMessage{"invalid_input", "The mesh\x1b[2J is bad.", "/meshes/0"};
  return job;
}

std::string problem(const char* code, const std::string& detail) {
  const Problem made = make_problem(code, detail);
  return http_answer(made.status, write_problem(made), kProblemMediaType);
}

Outcome kiln_with(const ScriptedServer& server, std::vector<std::string> words) {
  words.push_back("--server");
  words.push_back(server.url());
  return kiln(std::move(words));
}

ScriptedServer::Script always(const std::string& answer) {
  return [answer](const ScriptedRequest&) { return answer; };
}

TEST(Kiln, RefusesABadCommandLineWithTwo) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {},
           {"frobnicate"},
           {"bake"},
           {"bake", "x.json"},
           {"bake", "/nowhere/x.json", "-o", "/tmp", "--server", "http://127.0.0.1:9"},
           {"ls"},
           {"ls", "--server", "ftp://x"},
           {"ls", "--server", "http://x:99999"},
           {"wait", "a", "b"},
           {"ls", "--limit", "0"},
           {"ls", "--state", "done"},
           {"ls", "--label", "nothing"},
           {"wait", "a", "--timeout", "nan"},
           {"show", "x", "--token-file", "/nowhere", "--server", "http://127.0.0.1:9"}}) {
    const Outcome outcome = kiln(words);
    EXPECT_EQ(outcome.code, cli::kUsage) << (words.empty() ? "" : words[0]);
    EXPECT_EQ(outcome.out, "");
    EXPECT_NE(outcome.err, "");
  }
}

TEST(Kiln, ShowsHelpAndVersionWithZero) {
  EXPECT_EQ(kiln({"--help"}).code, 0);
  EXPECT_NE(kiln({"bake", "--help"}).out.find("--max-error"), std::string::npos);
  EXPECT_EQ(kiln({"version"}).out, std::string("kiln ") + LIGHTKILN_VERSION + "\n");
}

TEST(Kiln, ExitFollowsTheEndOfTheJob) {
  const std::vector<std::pair<std::string, int>> ends = {
      {"succeeded", cli::kSucceeded}, {"failed", cli::kFailed}, {"cancelled", cli::kCancelled}};
  for (const auto& [state, code] : ends) {
    ScriptedServer server(always(http_answer(200, write_job(job_in(state)))));
    const Outcome outcome = kiln_with(server, {"wait", "01JOB"});
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(outcome.err.find('\x1b'), std::string::npos)
        << "control bytes of a server reach the terminal";
  }
  ScriptedServer server(always(http_answer(200, write_job(job_in("succeeded")))));
  EXPECT_EQ(kiln_with(server, {"wait", "01JOB", "--max-error", "0.02"}).code, cli::kGateMissed);
  EXPECT_EQ(kiln_with(server, {"wait", "01JOB", "--max-error", "0.04"}).code, cli::kSucceeded);
}

TEST(Kiln, ExitFollowsTheProblem) {
  const std::vector<std::pair<const char*, int>> problems = {
      {"invalid_spec", cli::kInvalidOrder}, {"too_large", cli::kInvalidOrder},
      {"unauthorized", cli::kUnauthorized}, {"forbidden", cli::kUnauthorized},
      {"not_found", cli::kNotFound},        {"conflict", cli::kFailed},
      {"internal", cli::kFailed},           {"malformed_json", cli::kInvalidOrder},
      {"cancelled", cli::kCancelled}};
  for (const auto& [code, exit] : problems) {
    ScriptedServer server(always(problem(code, "A sentence.")));
    const Outcome outcome = kiln_with(server, {"cancel", "01JOB"});
    EXPECT_EQ(outcome.code, exit) << code;
    EXPECT_NE(outcome.err.find("A sentence."), std::string::npos);
  }
  EXPECT_EQ(cli::exit_code(Error(ErrorCode::unavailable, "x")), cli::kUnreachable);
}

TEST(Kiln, BakeAndFetchEndWithTheirCodes) {
  test::TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const std::string order = (folder.path() / "order.json").string();
  std::ofstream(order) << R"({"kind":"ambient_occlusion","inputs":{}})";
  ScriptedServer closed(always(problem("unauthorized", "A token is needed.")));
  EXPECT_EQ(kiln_with(closed, {"bake", order, "-o", out}).code, cli::kUnauthorized);
  EXPECT_EQ(closed.requests().size(), 1u) << "a refusal is not repeated";
  ScriptedServer gone(always(http_answer(200, write_job(job_in("cancelled")))));
  EXPECT_EQ(kiln_with(gone, {"fetch", "01JOB", "-o", out}).code, cli::kCancelled);
  EXPECT_FALSE(fs::exists(out));

  JobMessage job = job_in("succeeded");
  job.artifacts = {{"ao.exr", "image", "image/x-exr", 3, sha256_digest("abc", 3)}};
  ScriptedServer lying([&](const ScriptedRequest& request) {
    if (request.path == "/v1/jobs:validate")
      return http_answer(200, write_validation({"{}", "", {}}));
    if (request.path == "/v1/jobs") return http_answer(202, write_job(job));
    if (request.path.ends_with("/artifacts"))
      return http_answer(200, write_artifact_list("01JOB", job.artifacts));
    return http_answer(200, "abX");
  });
  EXPECT_EQ(kiln_with(lying, {"bake", order, "-o", out}).code, cli::kDigestMismatch);
  EXPECT_TRUE(fs::is_empty(out));
}

TEST(Kiln, SpeaksOfChunksOnlyWhereChunksAreBaked) {
  JobMessage job = job_in("succeeded");
  job.progress = {0, 4, "chunk", 1, std::nullopt};
  job.plan_only = true;
  ScriptedServer server(always(http_answer(200, write_job(job))));
  const Outcome planned = kiln_with(server, {"show", "01JOB"});
  EXPECT_EQ(planned.code, 0);
  EXPECT_EQ(planned.out.find("chunk"), std::string::npos) << planned.out;
}

TEST(Kiln, SaysThatThereWasNothingToBake) {
  JobMessage job = job_in("succeeded");
  job.quality.error.reset();
  Plan plan;
  plan.element_unit = "vertex";
  job.plan_json = write_plan(plan);
  ScriptedServer server([&](const ScriptedRequest& request) {
    return http_answer(200, request.path.ends_with("/artifacts") ? write_artifact_list("01JOB", {})
                                                                 : write_job(job));
  });
  test::TemporaryFolder folder;
  const Outcome outcome = kiln_with(server, {"fetch", "01JOB", "-o", folder.path().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("0 vertices: there was nothing to bake"), std::string::npos);
  EXPECT_EQ(outcome.out.find("not known"), std::string::npos);
}

TEST(Kiln, SaysThatAnotherServiceAnswered) {
  ScriptedServer server(always(http_answer(200, "<html></html>", "text/html")));
  EXPECT_EQ(kiln_with(server, {"show", "01JOB"}).code, cli::kUnreachable);
  ScriptedServer other(always(http_answer(404, "nothing", "text/html")));
  EXPECT_EQ(kiln_with(other, {"show", "01JOB"}).code, cli::kNotFound);
}

TEST(Kiln, TimeoutLeavesTheJobUnlessAskedToCancel) {
  const auto script = [](const ScriptedRequest& request) {
    return http_answer(200, write_job(job_in(request.method == "POST" ? "cancelled" : "running")));
  };
  ScriptedServer server(script);
  const Outcome outcome = kiln_with(server, {"wait", "01JOB", "--timeout", "0.2"});
  EXPECT_EQ(outcome.code, cli::kTimedOut);
  EXPECT_NE(outcome.err.find("kiln wait 01JOB --server"), std::string::npos);
  for (const ScriptedRequest& request : server.requests()) EXPECT_EQ(request.method, "GET");
  EXPECT_EQ(kiln_with(server, {"wait", "01JOB", "--timeout", "0.2", "--cancel-on-timeout"}).code,
            cli::kTimedOut);
  EXPECT_EQ(server.requests().back().path, "/v1/jobs/01JOB:cancel");
}

TEST(Kiln, TimeoutEndsEveryVerbWithItsOwnCode) {
  ScriptedServer server(always(problem("unavailable", "Full.")));
  for (const char* verb : {"show", "cancel", "wait"}) {
    const Outcome outcome = kiln_with(server, {verb, "01JOB", "--timeout", "0.3"});
    EXPECT_EQ(outcome.code, cli::kTimedOut) << verb;
    EXPECT_NE(outcome.err.find("--timeout passed"), std::string::npos) << outcome.err;
  }
}

TEST(Kiln, ListsPageAfterPageUpToItsLimit) {
  ScriptedServer server([](const ScriptedRequest& request) {
    JobPage page{{job_in("failed"), job_in("failed")}, "01JOB"};
    if (request.path.find("after=") != std::string::npos) page = {{job_in("queued")}, ""};
    return http_answer(200, write_job_page(page));
  });
  const Outcome outcome = kiln_with(server, {"ls", "--json"});
  EXPECT_EQ(read_job_page(outcome.out).items.size(), 3u);
  EXPECT_EQ(server.requests().back().path, "/v1/jobs?limit=48&after=01JOB");
  EXPECT_EQ(read_job_page(kiln_with(server, {"ls", "--json", "--limit", "2"}).out).next, "01JOB");
}

TEST(Kiln, PrintsDataToStdoutAndNothingElse) {
  ScriptedServer server(always(http_answer(200, write_job(job_in("succeeded")))));
  const Outcome outcome = kiln_with(server, {"show", "01JOB", "--json"});
  EXPECT_EQ(outcome.out, write_job(job_in("succeeded")) + "\n");
}

TEST(Kiln, SendsTheTokenOfAFile) {
  test::TemporaryFolder folder;
  const fs::path token = folder.path() / "token";
  std::ofstream(token) << "secret-1\n";
  ScriptedServer server(always(http_answer(200, write_job_page({}))));
  EXPECT_EQ(kiln_with(server, {"ls", "--token-file", token.string(), "--label", "a=b c"}).code, 0);
  EXPECT_EQ(server.requests().at(0).header("Authorization"), "Bearer secret-1");
  EXPECT_EQ(server.requests().at(0).path, "/v1/jobs?limit=50&label=a%3Ab%20c");
}

// --- downloads ----------------------------------------------------------------------------------

struct Artifacts {
  std::string bytes = "0123456789abcdef";
  ArtifactMessage message{"ao.exr", "image", "image/x-exr", 16,
                          sha256_digest("0123456789abcdef", 16)};

  std::string answer(const ScriptedRequest& request) const {
    if (request.path == "/v1/jobs/01JOB") return http_answer(200, write_job(job_in("succeeded")));
    if (request.path == "/v1/jobs/01JOB/artifacts")
      return http_answer(200, write_artifact_list("01JOB", {message}));
    return "";
  }
};

TEST(Fetch, GoesOnWhereTheConnectionBroke) {
  const Artifacts artifacts;
  ScriptedServer server([&](const ScriptedRequest& request) {
    if (!request.path.ends_with("ao.exr")) return artifacts.answer(request);
    if (request.header("Range").empty())
      return http_answer(200, artifacts.bytes)
          .substr(0, http_answer(200, artifacts.bytes).size() - 10);
    EXPECT_EQ(request.header("Range"), "bytes=6-");
    return http_answer(206, artifacts.bytes.substr(6), "image/x-exr",
                       "Content-Range: bytes 6-15/16\r\n");
  });
  test::TemporaryFolder folder;
  const Outcome outcome = kiln_with(server, {"fetch", "01JOB", "-o", folder.path().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(test::read_file(folder.path() / "ao.exr").size(), 16u);
  EXPECT_FALSE(fs::exists(folder.path() / "ao.exr.part"));
  // A second fetch finds the bytes in place.
  const size_t before = server.requests().size();
  EXPECT_EQ(kiln_with(server, {"fetch", "01JOB", "-o", folder.path().string()}).code, 0);
  EXPECT_EQ(server.requests().size(), before + 2);
}

TEST(Fetch, KeepsNothingOfOtherBytes) {
  const Artifacts artifacts;
  for (const std::string bytes : {"0123456789abcdeX", "0123456789abcdef and more"}) {
    ScriptedServer server([&](const ScriptedRequest& request) {
      return request.path.ends_with("ao.exr") ? http_answer(200, bytes) : artifacts.answer(request);
    });
    test::TemporaryFolder folder;
    EXPECT_EQ(kiln_with(server, {"fetch", "01JOB", "-o", folder.path().string()}).code,
              cli::kDigestMismatch);
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
}

TEST(Fetch, RefusesNamesThatLeadOutOfTheFolder) {
  for (const char* name : {"../evil", "/etc/evil", "a/b", "..", ".profile", ""}) {
    Artifacts artifacts;
    artifacts.message.name = name;
    ScriptedServer server([&](const ScriptedRequest& request) {
      const std::string answer = artifacts.answer(request);
      return answer.empty() ? http_answer(200, artifacts.bytes) : answer;
    });
    test::TemporaryFolder folder;
    EXPECT_EQ(kiln_with(server, {"fetch", "01JOB", "-o", (folder.path() / "out").string()}).code,
              cli::kUnreachable)
        << name;
    EXPECT_TRUE(fs::is_empty(folder.path() / "out"));
    EXPECT_FALSE(fs::exists(folder.path() / "evil"));
  }
}

TEST(Fetch, SaysWhichArtifactThereIsNot) {
  const Artifacts artifacts;
  ScriptedServer server([&](const ScriptedRequest& request) { return artifacts.answer(request); });
  test::TemporaryFolder folder;
  EXPECT_EQ(kiln_with(server, {"fetch", "01JOB", "other.exr", "-o", folder.path().string()}).code,
            cli::kNotFound);
}

// --- the client's patience -----------------------------------------------------------------------

ClientOptions impatient(const ScriptedServer& server) {
  ClientOptions options;
  options.server = server.url();
  options.retries = 3;
  options.first_pause_s = 0.01;
  options.read_timeout_s = 2;
  return options;
}

TEST(Client, TriesAgainWithTheSameKey) {
  int calls = 0;
  ScriptedServer server([&](const ScriptedRequest&) -> std::string {
    ++calls;
    if (calls == 1) return "";  // closed without a word
    if (calls == 2) return problem("unavailable", "Full.");
    return http_answer(202, write_job(job_in("queued")));
  });
  Client client(impatient(server));
  EXPECT_EQ(client.submit("{}", "key-1", 0).job.id, "01JOB");
  const auto requests = server.requests();
  ASSERT_EQ(requests.size(), 3u);
  for (const ScriptedRequest& request : requests) {
    EXPECT_EQ(request.header("Idempotency-Key"), "key-1");
    EXPECT_EQ(request.body, "{}");
  }
}

TEST(Client, GivesUpAfterItsTriesAndNeverRepeatsARefusal) {
  ScriptedServer full(always(problem("too_many_requests", "Slow down.")));
  EXPECT_THROW(Client(impatient(full)).job("x"), ServerProblem);
  EXPECT_EQ(full.requests().size(), 4u);
  ScriptedServer strict(always(problem("invalid_spec", "No.")));
  EXPECT_THROW(Client(impatient(strict)).job("x"), ServerProblem);
  EXPECT_EQ(strict.requests().size(), 1u);
}

TEST(Client, StreamsUploadsUnderTheirDigest) {
  test::TemporaryFolder folder;
  const fs::path file = folder.path() / "blob";
  std::ofstream(file, std::ios::binary) << std::string(200000, 'x');
  std::ofstream(folder.path() / "empty");
  ScriptedServer server(always(http_answer(201, "")));
  Client client(impatient(server));
  const FileDigest hashed = sha256_file(file);
  EXPECT_TRUE(client.upload(hashed.digest, file, hashed.bytes));
  EXPECT_EQ(server.requests().at(0).path, "/v1/blobs/" + hashed.digest);
  EXPECT_EQ(server.requests().at(0).body, std::string(200000, 'x'));
  const FileDigest empty = sha256_file(folder.path() / "empty");
  EXPECT_TRUE(client.upload(empty.digest, folder.path() / "empty", empty.bytes));
  EXPECT_EQ(server.requests().at(1).header("Content-Length"), "0");
}

TEST(Client, StopsWhenInterrupted) {
  ScriptedServer server(always(problem("unavailable", "Full.")));
  ClientOptions options = impatient(server);
  options.retries = 1000;
  options.interrupted = [&] { return server.requests().size() >= 2; };
  try {
    Client(options).job("x");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::cancelled);
  }
}

// --- orders --------------------------------------------------------------------------------------

TEST(Order, ReplacesPathsByDigestsAndBringsGltfFilesAlong) {
  test::TemporaryFolder folder;
  std::ofstream(folder.path() / "a b.bin") << "buffer";
  std::ofstream(folder.path() / "room.gltf")
      << R"({"buffers":[{"uri":"a%20b.bin"},{"uri":"data:,x"}],"images":[{"uri":"a%20b.bin"},{"bufferView":0}]})";
  std::ofstream(folder.path() / "order.json")
      << R"({"kind":"ambient_occlusion","inputs":{"scene":"room.gltf"}})";
  const Order order = read_order(folder.path() / "order.json");
  EXPECT_EQ(order.blobs.size(), 2u);
  const ParsedSpec parsed = parse_spec(order.spec_json);
  ASSERT_TRUE(parsed.faults.empty()) << parsed.faults[0].message;
  ASSERT_EQ(parsed.spec.scene->resources.size(), 1u);
  EXPECT_EQ(parsed.spec.scene->resources[0].first, "a b.bin");
  EXPECT_EQ(parsed.spec.scene->resources[0].second, sha256_digest("buffer", 6));
}

TEST(Order, BringsTheSixFilesOfACubeAlong) {
  test::TemporaryFolder folder;
  std::string faces;
  for (const char* face : {"px", "nx", "py", "ny", "pz", "nz"}) {
    std::ofstream(folder.path() / (std::string(face) + ".exr")) << face;
    faces += std::string(faces.empty() ? "" : ",") + "\"" + face + "\":\"" + face + ".exr\"";
  }
  std::ofstream(folder.path() / "order.json")
      << R"({"kind":"environment_maps","inputs":{"environment":{"faces":{)" + faces +
             R"(}}},"parameters":{"sh":{}}})";
  const Order order = read_order(folder.path() / "order.json");
  EXPECT_EQ(order.blobs.size(), 6u);
  const ParsedSpec parsed = parse_spec(order.spec_json);
  ASSERT_TRUE(parsed.faults.empty()) << parsed.faults[0].message;
  ASSERT_EQ(parsed.spec.environment->faces.size(), 6u);
  EXPECT_EQ(parsed.spec.environment->faces[2], sha256_digest("py", 2));
}

TEST(Order, RefusesGltfFilesOutsideItsFolder) {
  for (const char* uri : {"../secret", "/etc/passwd", "http://x/y.bin", "a/../../b",
                          "%2e%2e/secret", "..%2fsecret", "file:x", "a\\\\b", ""})
    EXPECT_THROW(gltf_file_uris(std::string(R"({"buffers":[{"uri":")") + uri + "\"}]}"), Error)
        << uri;
  EXPECT_EQ(gltf_file_uris(R"({"images":[{"uri":"sub/x.png"}]})").size(), 1u);
}

TEST(Order, FollowsLinksOnlyBelowTheFolderOfTheGltf) {
  test::TemporaryFolder folder;
  const fs::path inside = folder.path() / "scene";
  fs::create_directories(inside / "sub");
  std::ofstream(folder.path() / "secret") << "secret";
  std::ofstream(inside / "sub" / "real.bin") << "buffer";
  fs::create_symlink("sub/real.bin", inside / "good.bin");
  fs::create_symlink("../secret", inside / "bad.bin");
  fs::create_directory_symlink("..", inside / "up");
  const auto read = [&](const std::string& uri) {
    std::ofstream(inside / "room.gltf") << R"({"buffers":[{"uri":")" + uri + "\"}]}";
    std::ofstream(folder.path() / "order.json")
        << R"({"kind":"ambient_occlusion","inputs":{"scene":"scene/room.gltf"}})";
    return read_order(folder.path() / "order.json");
  };
  EXPECT_EQ(read("good.bin").blobs.size(), 2u);
  EXPECT_THROW(read("bad.bin"), Error);
  EXPECT_THROW(read("up/secret"), Error);
}

TEST(Order, NamesTheInputThatCannotBeRead) {
  test::TemporaryFolder folder;
  std::ofstream(folder.path() / "order.json")
      << R"({"kind":"ambient_occlusion","inputs":{"scene":"nowhere.glb"}})";
  try {
    read_order(folder.path() / "order.json");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_spec);
    EXPECT_EQ(error.where(), "/inputs/scene");
  }
}

TEST(Bake, TellsEveryFaultOfAnOrder) {
  Problem refusal = make_problem("invalid_spec", "The order has 2 faults.");
  refusal.errors.push_back({"/spec/seed", "range", "The seed is wrong.", "", ""});
  refusal.errors.push_back({"/spec/knd", "unknown", "Unknown.", "", "kind"});
  ScriptedServer server(always(http_answer(422, write_problem(refusal), kProblemMediaType)));
  test::TemporaryFolder folder;
  std::ofstream(folder.path() / "order.json") << R"({"kind":"ambient_occlusion","inputs":{}})";
  const Outcome outcome = kiln_with(server, {"bake", (folder.path() / "order.json").string(), "-o",
                                             (folder.path() / "out").string()});
  EXPECT_EQ(outcome.code, cli::kInvalidOrder);
  EXPECT_NE(outcome.err.find("/spec/seed: The seed is wrong."), std::string::npos);
  EXPECT_NE(outcome.err.find("Did you mean \"kind\"?"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
}

// --- the whole way
// --------------------------------------------------------------------------------

TEST(Bake, BakesWithADaemonOfItsOwnAndAnswersTheSecondFromTheStore) {
  const fs::path kilnd = fs::path(LIGHTKILN_BINARY_DIR) / "kilnd";
  const fs::path scene = fs::path(LIGHTKILN_SOURCE_DIR) / "deploy" / "demo" / "courtyard.glb";
  if (!fs::exists(kilnd) || !fs::exists(kilnd.parent_path() / "kiln-oven"))
    GTEST_SKIP() << "kilnd and kiln-oven are not built";
  setenv("LIGHTKILN_KILND", kilnd.c_str(), 1);
  test::TemporaryFolder folder;
  fs::copy_file(scene, folder.path() / "scene.glb");
  const fs::path order = folder.path() / "order.json";
  std::ofstream(order) << R"({"kind":"ambient_occlusion","inputs":{"scene":"scene.glb"},)"
                          R"("parameters":{"max_distance":6,"falloff":"linear"},)"
                          R"("accuracy":{"target_error":0.1}})";
  const auto bake = [&](const std::string& out) {
    return kiln({"bake", order.string(), "-o", (folder.path() / out).string(), "--store",
                 (folder.path() / "store").string(), "--threads", "2", "--timeout", "120"});
  };
  const Outcome first = bake("one");
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_NE(first.out.find("accuracy.json"), std::string::npos);
  const Outcome second = bake("two");
  ASSERT_EQ(second.code, 0) << second.err;
  for (const auto& entry : fs::directory_iterator(folder.path() / "one"))
    EXPECT_EQ(test::read_file(entry.path()),
              test::read_file(folder.path() / "two" / entry.path().filename()));
  const Outcome plan = kiln(
      {"plan", order.string(), "--store", (folder.path() / "store").string(), "--timeout", "120"});
  EXPECT_EQ(plan.code, 0) << plan.err;
  EXPECT_NE(plan.out.find("effect"), std::string::npos);
  const fs::path png = folder.path() / "ao.png";
  EXPECT_EQ(kiln({"view", (folder.path() / "one" / "ambient_occlusion.exr").string(), "-o",
                  png.string(), "--exposure", "1"})
                .code,
            0);
  EXPECT_GT(fs::file_size(png), 100u);
  EXPECT_EQ(kiln({"view", order.string(), "-o", png.string()}).code, cli::kInvalidOrder);
  unsetenv("LIGHTKILN_KILND");
}

TEST(Bake, TriesAHopelessOrderOnce) {
  const fs::path kilnd = fs::path(LIGHTKILN_BINARY_DIR) / "kilnd";
  if (!fs::exists(kilnd) || !fs::exists(kilnd.parent_path() / "kiln-oven"))
    GTEST_SKIP() << "kilnd and kiln-oven are not built";
  setenv("LIGHTKILN_KILND", kilnd.c_str(), 1);
  test::TemporaryFolder folder;
  std::ofstream(folder.path() / "scene.glb") << "no scene at all";
  const fs::path order = folder.path() / "order.json";
  std::ofstream(order) << R"({"kind":"ambient_occlusion","inputs":{"scene":"scene.glb"}})";
  for (int round = 0; round < 2; ++round) {
    const Outcome outcome =
        kiln({"bake", order.string(), "-o", (folder.path() / "out").string(), "--store",
              (folder.path() / "store").string(), "--threads", "1", "--timeout", "120", "--json"});
    EXPECT_EQ(outcome.code, cli::kFailed) << outcome.err;
    const JobMessage job = read_job(outcome.out);
    EXPECT_EQ(job.attempts, 1) << round;
    ASSERT_TRUE(job.error);
    EXPECT_EQ(job.error->code, "invalid_input");
  }
  unsetenv("LIGHTKILN_KILND");
}

TEST(Bake, SaysWhyThePrivateDaemonDidNotStart) {
  test::TemporaryFolder folder;
  const fs::path order = folder.path() / "order.json";
  std::ofstream(order) << "{}";
  setenv("LIGHTKILN_KILND", "/bin/false", 1);
  const Outcome outcome = kiln({"bake", order.string(), "-o", (folder.path() / "out").string(),
                                "--store", (folder.path() / "store").string()});
  unsetenv("LIGHTKILN_KILND");
  EXPECT_EQ(outcome.code, cli::kFailed);
  EXPECT_NE(outcome.err.find("kilnd ended while starting"), std::string::npos);
}

TEST(Text, IsReadable) {
  EXPECT_EQ(cli::format_count(1234567), "1 234 567");
  EXPECT_EQ(cli::format_count(12), "12");
  EXPECT_EQ(cli::format_units(0, "vertex"), "0 vertices");
  EXPECT_EQ(cli::format_units(1, "vertex"), "1 vertex");
  EXPECT_EQ(cli::format_units(1234, "probe"), "1 234 probes");
  EXPECT_EQ(cli::format_seconds(200), "3 min 20 s");
  EXPECT_EQ(cli::format_seconds(7500), "2 h 05 min");
  EXPECT_EQ(cli::printable("a\x1b[1mb\n\xC2\x9B\xC3\xA9"), "a?[1mb??\xC3\xA9");
}

}  // namespace
}  // namespace lightkiln

// What a worker does with ovens that are not what they should be: scripts that say anything.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include <gtest/gtest.h>
#include <unistd.h>

#include "server/worker/back_off.h"
#include "server/worker/feed.h"
#include "server/worker/worker.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

std::string frame(FrameType type, const std::string& payload) {
  return frame_header(type, payload.size()) + payload;
}

class FakeOven : public testing::Test {
 protected:
  // A program that runs `lines`, sends `frames` and then listens until its worker hangs up.
  std::string program(const std::string& frames, const std::string& lines = "") {
    test::write_file(folder.path() / "frames", bytes_of(frames));
    const std::string path = (folder.path() / "oven").string();
    test::write_file(
        path, bytes_of("#!/bin/sh\n" + lines + "\n/bin/cat " + (folder.path() / "frames").string() +
                       " >&3\nexec /bin/cat <&3 >/dev/null\n"));
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  }

  // The sentence with which `ask` gives up on an oven that sends `frames`; "" when it does not.
  std::string fault(const std::string& frames, const std::function<void(OvenProcess&)>& ask) {
    OvenProcess oven({program(frames), 0}, [] { return false; });
    try {
      ask(oven);
    } catch (const OvenFailure& failure) {
      EXPECT_EQ(failure.error.code, "internal");
      EXPECT_FALSE(failure.crashed);
      return failure.error.detail;
    }
    return "";
  }

  test::TemporaryFolder folder;
};

constexpr double kNotNumbers[] = {std::numeric_limits<double>::quiet_NaN(),
                                  std::numeric_limits<double>::infinity(),
                                  -std::numeric_limits<double>::infinity()};

TEST_F(FakeOven, NumbersThatAreNoneAreRefusedByName) {
  const auto ignore = [](double) {};
  const auto planned = [](double predicted_s) {
    return frame(FrameType::plan_result,
                 PayloadWriter().text("{}").number(1).real(predicted_s).take());
  };
  const auto baked = [](double error_sum_sq) {
    return frame(FrameType::chunk_result,
                 PayloadWriter().bytes({}).text("{}").number(4).real(error_sum_sq).take());
  };
  const auto progress = [](double fraction) {
    return frame(FrameType::progress, PayloadWriter().real(fraction).take());
  };
  const auto plan = [&](OvenProcess& oven) { feed_plan(oven, ignore); };
  const auto chunk = [&](OvenProcess& oven) { feed_chunk(oven, 0, ignore); };
  const auto assemble = [&](OvenProcess& oven) {
    feed_assembly(
        oven, [](NewArtifact) {}, ignore);
  };
  const std::string ended = frame(FrameType::result, PayloadWriter().text("{}").take());

  EXPECT_EQ(fault(progress(0.5) + planned(2), plan), "");
  EXPECT_EQ(fault(progress(0.5) + baked(2), chunk), "");
  EXPECT_EQ(fault(progress(0.5) + ended, assemble), "");
  for (const double value : kNotNumbers) {
    EXPECT_NE(fault(planned(value), plan).find("predicted time"), std::string::npos) << value;
    EXPECT_NE(fault(baked(value), chunk).find("squared errors"), std::string::npos) << value;
    EXPECT_NE(fault(progress(value) + planned(2), plan).find("progress"), std::string::npos);
    EXPECT_NE(fault(progress(value) + ended, assemble).find("progress"), std::string::npos);
  }
}

TEST_F(FakeOven, InheritsNothingOfTheEnvironment) {
#ifdef LIGHTKILN_SANITIZED
  GTEST_SKIP() << "sanitizers take their options from the environment";
#endif
  ASSERT_EQ(setenv("LIGHTKILN_TEST_SECRET", "hidden", 1), 0);
  const std::string seen = (folder.path() / "seen").string();
  const std::string planned =
      frame(FrameType::plan_result, PayloadWriter().text("{}").number(1).real(1).take());
  OvenProcess oven({program(planned, "/bin/cat /proc/$$/environ > " + seen), 0},
                   [] { return false; });
  feed_plan(oven, [](double) {});  // the script has written by now
  unsetenv("LIGHTKILN_TEST_SECRET");
  EXPECT_TRUE(test::read_file(seen).empty());
}

std::string greeting(const std::vector<std::string>& missing) {
  PayloadWriter hello;
  hello.number(missing.size());
  for (const std::string& layer : missing) hello.text(layer);
  return frame(FrameType::hello, hello.take());
}

TEST_F(FakeOven, IsNotUsedWhereItsSandboxLacksWhatIsNotAllowedToBeMissing) {
  const auto refusal = [&](const std::vector<std::string>& missing,
                           const std::vector<std::string>& allowed) -> std::string {
    WorkerOptions options;
    options.store_directory = folder.path() / "store";
    options.oven_path = program(greeting(missing));
    options.exit_when_idle = true;
    options.allow_missing_sandbox = allowed;
    try {
      EXPECT_EQ(run_worker(options), 0);
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::unavailable);
      return error.what();
    }
  };
  EXPECT_EQ(refusal({}, {}), "");
  EXPECT_EQ(refusal({"landlock"}, {"landlock"}), "");
  EXPECT_EQ(refusal({"landlock", "seccomp"}, {"all"}), "");
  const std::string why = refusal({"namespaces", "landlock", "seccomp"}, {"landlock"});
  EXPECT_NE(why.find("has no network"), std::string::npos) << why;
  EXPECT_NE(why.find("--allow-missing-sandbox namespaces,seccomp."), std::string::npos) << why;
}

TEST_F(FakeOven, TellsTheStoreWhatItsSandboxLacks) {
  StoreOptions kept;
  kept.directory = folder.path() / "store";
  const std::unique_ptr<Store> store = open_sqlite_store(kept);
  WorkerOptions options;
  options.store_directory = kept.directory;
  options.oven_path = program(greeting({"landlock", "seccomp"}));
  options.name = "w";
  options.exit_when_idle = true;
  options.allow_missing_sandbox = {"landlock", "seccomp"};
  EXPECT_EQ(run_worker(options), 0);
  const std::vector<WorkerRecord> workers = store->workers();
  ASSERT_EQ(workers.size(), 1u);
  EXPECT_EQ(workers[0].name.substr(0, 2), "w-");
  EXPECT_EQ(workers[0].missing_layers, (std::vector<std::string>{"landlock", "seccomp"}));
}

TEST(BackOff, DoublesFromATenthToFiveSecondsAndSpeaksOncePerChange) {
  BackOff back_off;
  EXPECT_EQ(back_off.pause_s(), 0);
  EXPECT_FALSE(back_off.obliged()) << "no news before the first refusal";
  EXPECT_TRUE(back_off.refused("full"));
  EXPECT_DOUBLE_EQ(back_off.pause_s(), 0.1);
  for (const double expected_s : {0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0}) {
    EXPECT_FALSE(back_off.refused("full"));
    EXPECT_DOUBLE_EQ(back_off.pause_s(), expected_s);
  }
  EXPECT_TRUE(back_off.refused("busy"));
  EXPECT_TRUE(back_off.obliged());
  EXPECT_EQ(back_off.pause_s(), 0);
  EXPECT_FALSE(back_off.obliged());
  EXPECT_TRUE(back_off.refused("busy"));
}

}  // namespace
}  // namespace lightkiln

// The example of a pipeline: its exit code is what a pipeline judges by.

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <sys/wait.h>

#include "server/cli/commands/exit_code.h"
#include "tests/support/data.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;

class CiExample : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"kiln", "kilnd", "kiln-oven"})
      if (!fs::exists(fs::path(LIGHTKILN_BINARY_DIR) / program))
        GTEST_SKIP() << program << " is not built";
    fs::create_directory(orders());
  }
  fs::path orders() const { return folder.path() / "orders"; }
  void order(const std::string& name, const std::string& scene) const {
    std::ofstream(orders() / (name + ".json"))
        << R"({"kind":"ambient_occlusion","inputs":{"scene":")" << scene
        << R"("},"accuracy":{"target_error":0.05}})";
  }
  // The exit code of the script with the programs of this build.
  int run(const std::string& more = "") const {
    const std::string line =
        "PATH='" LIGHTKILN_BINARY_DIR ":'\"$PATH\" LIGHTKILN_SERVER= LIGHTKILN_STORE='" +
        (folder.path() / "store").string() + "' '" LIGHTKILN_SOURCE_DIR "/deploy/ci/bake.sh' '" +
        orders().string() + "' '" + (folder.path() / "results").string() + "' " + more + " >'" +
        (folder.path() / "log").string() + "' 2>&1";
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  bool has_result(const std::string& name) const {
    return fs::exists(folder.path() / "results" / name / "ambient_occlusion.json");
  }

  const test::TemporaryFolder folder;
};

TEST_F(CiExample, FailsWhenAnOrderFailsAndBakesTheOthers) {
  EXPECT_EQ(run(), cli::kUsage) << "no order at all is a mistake";
  test::MeshData mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
  mesh.triangles = {{0, 1, 2}};
  test::write_file(orders() / "triangle.glb", test::make_glb(mesh));
  order("good", "triangle.glb");
  EXPECT_EQ(run(), cli::kSucceeded);
  EXPECT_TRUE(has_result("good"));

  std::ofstream(orders() / "broken.glb") << "no scene";
  order("a_bad_one", "broken.glb");
  fs::remove_all(folder.path() / "results");
  EXPECT_EQ(run(), cli::kFailed);
  EXPECT_TRUE(has_result("good"));
  EXPECT_FALSE(has_result("a_bad_one"));

  fs::remove(orders() / "a_bad_one.json");
  EXPECT_EQ(run("0"), cli::kGateMissed) << "no estimate is below 0";
}

}  // namespace
}  // namespace lightkiln

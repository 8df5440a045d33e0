#include <fstream>

#include <gtest/gtest.h>

#include "core/environment/lookup_cube.h"
#include "core/image/exr.h"
#include "server/cli/commands/commands.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

// What `kiln view` says while it shows a cube with these attributes.
std::string words_of(const std::map<std::string, std::string>& attributes) {
  const test::TemporaryFolder folder;
  ExrWriteOptions options;
  options.attributes = attributes;
  const std::vector<std::byte> bytes = write_exr(Image(2, 12, 3), options);
  cli::Arguments arguments;
  arguments.target = (folder.path() / "cube.exr").string();
  arguments.output = (folder.path() / "cube.png").string();
  std::ofstream(arguments.target, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  testing::internal::CaptureStderr();
  EXPECT_EQ(cli::view(arguments), cli::kSucceeded);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_GT(std::filesystem::file_size(arguments.output), 50u);
  return said;
}

TEST(View, SaysThatFacesAreThoseOfGraphicsInterfaces) {
  EXPECT_EQ(words_of({}), "");
  EXPECT_EQ(words_of({{kFaceOrientationAttribute, "openexr"}}), "");
  const std::string said = words_of({{kFaceOrientationAttribute, "opengl"}});
  EXPECT_NE(said.find("as OpenGL looks them up"), std::string::npos) << said;
}

}  // namespace
}  // namespace lightkiln

#pragma once

// Real files for tests, where they are present: a folder `shared/data` beside the project, or the
// folder that LIGHTKILN_TEST_DATA names. Tests that need it skip aloud where it is absent.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace lightkiln::test {

// The folder, or nothing.
std::optional<std::filesystem::path> data_folder();

std::vector<std::byte> read_file(const std::filesystem::path& path);
void write_file(const std::filesystem::path& path, const std::vector<std::byte>& bytes);

// A fresh folder that is removed with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace lightkiln::test

// Skips the running test, saying so, when the data folder is absent; otherwise defines `data`.
#define LIGHTKILN_NEEDS_DATA(data)                                               \
  const auto data##_found = ::lightkiln::test::data_folder();                    \
  if (!data##_found) GTEST_SKIP() << "no shared/data folder beside the project"; \
  const std::filesystem::path& data = *data##_found

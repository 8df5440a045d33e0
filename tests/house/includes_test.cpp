// The house as the README draws it: includes run downwards only, and each third-party library has
// one room (or the rooms listed here).

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

struct Include {
  std::string file;    // from the project's root
  std::string target;  // as written between quotes or brackets
  bool quoted = false;
};

std::vector<Include> includes_below(const std::string& folder) {
  static const std::regex pattern(R"(^\s*#\s*include\s*(["<])([^">]+)[">])");
  std::vector<Include> found;
  const fs::path root(LIGHTKILN_SOURCE_DIR);
  for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".h" && extension != ".cpp") continue;
    if (entry.path().string().find("node_modules") != std::string::npos) continue;
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line);) {
      std::smatch match;
      if (std::regex_search(line, match, pattern)) {
        found.push_back({fs::relative(entry.path(), root).string(), match[2], match[1] == "\""});
      }
    }
  }
  return found;
}

// Floors from the ground up. A file may include its own floor and any below it.
const std::vector<std::vector<std::string>> kFloors = {
    {"core/base/"},
    {"core/image/"},
    {"core/sphere/", "core/scene/"},
    {"core/environment/"},
    {"core/trace/"},
    {"core/bake/"},
    {"proto/"},
    {"server/store/", "server/oven/"},
    {"server/worker/"},
    {"server/http/"},
    {"server/daemon/", "server/cli/"},
    {"server/"},
};

int floor_of(const std::string& path) {
  for (size_t floor = 0; floor < kFloors.size(); ++floor) {
    for (const std::string& room : kFloors[floor]) {
      if (path.starts_with(room)) return static_cast<int>(floor);
    }
  }
  return -1;
}

std::vector<std::string> upward_arrows(const std::vector<Include>& includes) {
  std::vector<std::string> wrong;
  for (const Include& include : includes) {
    if (!include.quoted) continue;
    const int from = floor_of(include.file);
    const int to = floor_of(include.target);
    if (to < 0 || to > from) wrong.push_back(include.file + " includes " + include.target);
  }
  return wrong;
}

std::vector<Include> all_includes() {
  std::vector<Include> all;
  for (const char* folder : {"core", "proto", "server"}) {
    const std::vector<Include> some = includes_below(folder);
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

TEST(House, IncludesRunDownwardsOnly) {
  const std::vector<Include> includes = all_includes();
  ASSERT_GT(includes.size(), 100u);
  EXPECT_EQ(upward_arrows(includes), std::vector<std::string>{});
}

TEST(House, AnUpwardArrowWouldBeSeen) {
  EXPECT_EQ(upward_arrows({{"core/image/exr.cpp", "core/bake/bake.h", true}}).size(), 1u);
  EXPECT_EQ(upward_arrows({{"core/bake/bake.cpp", "proto/json.h", true}}).size(), 1u);
}

TEST(House, EachLibraryHasItsOwnRoom) {
  const std::map<std::string, std::vector<std::string>> rooms = {
      {"embree3/", {"core/trace/"}},
      {"Imf", {"core/image/"}},  // OpenEXR
      {"tiny_gltf.h", {"core/scene/"}},
      {"draco/", {"core/scene/"}},
      {"meshoptimizer.h", {"core/scene/"}},
      {"stb/", {"core/image/"}},
      // The room of glTF reads the JSON that tinygltf brings along, before tinygltf may see it.
      {"nlohmann/", {"proto/", "core/scene/"}},
      {"httplib.h", {"server/http/", "proto/client"}},
      {"sqlite3.h", {"server/store/"}},
      {"seccomp.h", {"server/oven/"}},
      {"CLI/", {"server/cli/", "server/daemon/", "server/kilnd.cpp"}},
  };
  std::map<std::string, int> seen;
  for (const Include& include : all_includes()) {
    for (const auto& [library, allowed] : rooms) {
      if (!include.target.starts_with(library)) continue;
      ++seen[library];
      bool home = false;
      for (const std::string& room : allowed) home = home || include.file.starts_with(room);
      EXPECT_TRUE(home) << include.file << " includes " << include.target;
    }
  }
  for (const char* library : {"embree3/", "Imf", "httplib.h", "sqlite3.h", "nlohmann/"}) {
    EXPECT_GT(seen[library], 0) << library << " is used nowhere: is the pattern still right?";
  }
}

TEST(House, NoThirdPartyTypeInAHeader) {
  for (const Include& include : all_includes()) {
    if (!include.file.ends_with(".h") || include.quoted) continue;
    const bool system = include.target.starts_with("sys/") || include.target.starts_with("linux/");
    EXPECT_TRUE(system || include.target.find('/') == std::string::npos)
        << include.file << " brings " << include.target << " into every file that includes it";
  }
}

}  // namespace

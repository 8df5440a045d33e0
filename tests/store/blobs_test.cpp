// Blobs whose file is there already: written by another process, or damaged since.

#include "server/store/blobs.h"

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/data.h"

namespace {

std::mutex g_mutex;
std::vector<std::string> g_synced;  // what fsync was called for

}  // namespace

// Stands before the C library's, and does the same.
extern "C" int fsync(int fd) {
  {
    char path[4096] = {};
    const std::string link = "/proc/self/fd/" + std::to_string(fd);
    if (readlink(link.c_str(), path, sizeof path - 1) > 0) {
      const std::lock_guard lock(g_mutex);
      g_synced.emplace_back(path);
    }
  }
  return static_cast<int>(syscall(SYS_fsync, fd));
}

namespace lightkiln {
namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

class BlobsTest : public testing::Test {
 protected:
  std::filesystem::path path_of(const std::string& digest) const {
    return root() / digest.substr(7, 2) / digest.substr(7);
  }
  std::filesystem::path root() const { return std::filesystem::canonical(folder.path()) / "blobs"; }
  static long folder_syncs(const std::filesystem::path& folder) {
    const std::lock_guard lock(g_mutex);
    return std::count(g_synced.begin(), g_synced.end(), folder.string());
  }

  test::TemporaryFolder folder;
};

TEST_F(BlobsTest, AKnownFilesFolderIsMadeDurableToo) {
  Blobs first(root().string()), second(root().string());
  const std::string digest = first.put(bytes_of("abc"));
  close(second.open(digest, nullptr));
  const auto shard = path_of(digest).parent_path();
  const long before = folder_syncs(shard);
  EXPECT_GE(before, 1) << "the count sees the first writer's";
  second.put(bytes_of("abc"));
  EXPECT_EQ(folder_syncs(shard), before + 1);
  Blobs::Draft draft(second);
  draft.append("abc", 3);
  EXPECT_FALSE(draft.keep());
  EXPECT_EQ(folder_syncs(shard), before + 2);
}

TEST_F(BlobsTest, SendingTheBytesAgainRepairsADamagedFileThatNobodyOpened) {
  std::string digest;
  {
    Blobs before(root().string());
    digest = before.put(bytes_of("abc"));
  }
  test::write_file(path_of(digest), bytes_of("abX"));
  Blobs uploading(root().string());
  {
    Blobs::Draft draft(uploading);
    draft.append("abc", 3);
    EXPECT_FALSE(draft.keep()) << "known already";
  }
  EXPECT_EQ(Blobs(root().string()).read(digest), "abc");
  test::write_file(path_of(digest), bytes_of("abX"));
  Blobs putting(root().string());
  EXPECT_EQ(putting.put(bytes_of("abc")), digest);
  EXPECT_EQ(Blobs(root().string()).read(digest), "abc");
}

}  // namespace
}  // namespace lightkiln

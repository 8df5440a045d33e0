#include "server/oven/preview.h"

#include <gtest/gtest.h>

#include "core/image/ldr.h"

namespace lightkiln {
namespace {

std::vector<Picture> some_pictures() {
  std::vector<Picture> pictures;
  for (int i = 0; i < 9; ++i) {
    Picture picture{"map_" + std::to_string(i) + ".exr", Image(20 + i, 10, 3)};
    for (size_t k = 0; k < picture.pixels.pixels.size(); ++k) {
      picture.pixels.pixels[k] = 0.07f * static_cast<float>((k + static_cast<size_t>(i)) % 13);
    }
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

TEST(Preview, IsAPngOfEachPictureInTheirOrderForAnyNumberOfThreads) {
  const std::vector<Picture> pictures = some_pictures();
  Progress progress;
  const std::vector<Artifact> one = make_previews(pictures, 1, progress);
  ASSERT_EQ(one.size(), pictures.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].name, pictures[i].artifact + ".png");
    EXPECT_EQ(one[i].role, "preview");
    EXPECT_EQ(one[i].media_type, "image/png");
    const Image8 shown = read_ldr(one[i].bytes);
    EXPECT_EQ(shown.width, pictures[i].pixels.width);
    EXPECT_EQ(shown.height, 10);
  }
  for (const int threads : {2, 8}) {
    const std::vector<Artifact> more = make_previews(pictures, threads, progress);
    for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(more[i].bytes, one[i].bytes) << threads;
  }
}

TEST(Preview, StopsWhenItIsCancelled) {
  Progress progress;
  progress.cancel();
  EXPECT_THROW(make_previews(some_pictures(), 2, progress), Error);
}

}  // namespace
}  // namespace lightkiln

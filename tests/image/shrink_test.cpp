#include "core/image/shrink.h"

#include <gtest/gtest.h>

namespace lightkiln {
namespace {

TEST(Shrink, LeavesAnImageThatFitsAsItIs) {
  Image image(7, 3, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<float>(i);
  EXPECT_EQ(shrink(image, 7).pixels, image.pixels);
}

TEST(Shrink, KeepsProportionsAndTheMeanOfEachChannel) {
  Image image(64, 384, 3);
  double before[3] = {};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        image.at(x, y)[c] = static_cast<float>((x * (c + 1) + 5 * y) % 17);
        before[c] += static_cast<double>(image.at(x, y)[c]);
      }
    }
  }
  const Image small = shrink(image, 96);
  EXPECT_EQ(small.width, 16);
  EXPECT_EQ(small.height, 96);
  for (int c = 0; c < 3; ++c) {
    double after = 0;
    for (size_t i = static_cast<size_t>(c); i < small.pixels.size(); i += 3) {
      after += static_cast<double>(small.pixels[i]);
    }
    EXPECT_NEAR(16 * after, before[c], 1e-5 * before[c]) << c;
  }
}

TEST(Shrink, LeavesOneTexelOfTheShorterSide) {
  const Image small = shrink(Image(1000, 1, 1), 10);
  EXPECT_EQ(small.width, 10);
  EXPECT_EQ(small.height, 1);
}

}  // namespace
}  // namespace lightkiln

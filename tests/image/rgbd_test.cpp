#include "core/image/rgbd.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

namespace lightkiln {
namespace {

Image one(float r, float g, float b) {
  Image image(1, 1, 3);
  image.pixels = {r, g, b};
  return image;
}

// The viewer's decoder, written as its shader does.
double viewer(uint8_t colour, uint8_t divisor) {
  return std::pow(colour / 255.0, 2.2) / (divisor / 255.0);
}

TEST(Rgbd, DecodesAsTheViewersShader) {
  for (const int divisor : {1, 2, 17, 128, 255}) {
    for (int code = 0; code < 256; ++code) {
      const uint8_t rgbd[4] = {static_cast<uint8_t>(code), 0, 255, static_cast<uint8_t>(divisor)};
      const Vec3d value = decode_rgbd(rgbd);
      EXPECT_NEAR(value.x, viewer(rgbd[0], rgbd[3]), 1e-12 * (1 + value.x));
      EXPECT_EQ(value.y, 0);
      EXPECT_NEAR(value.z, 255.0 / divisor, 1e-12 * value.z);
    }
  }
}

// Every step as the header states it, over ten decades.
TEST(Rgbd, ErrsByLessThanOneStep) {
  for (double largest = 1e-6; largest <= 255; largest *= 1.003) {
    const Image image = one(static_cast<float>(largest), static_cast<float>(0.37 * largest), 0);
    const Image8 packed = encode_rgbd(image);
    ASSERT_GE(packed.pixels[3], 1);
    const Vec3d value = decode_rgbd(packed.pixels.data());
    const double allowed = largest > 1 ? 0.006 * largest : 0.0044 * std::pow(largest, 0.55) + 1e-5;
    EXPECT_LE(std::abs(value.x - largest), allowed) << largest;
    EXPECT_LE(std::abs(value.y - 0.37 * largest), allowed) << largest;
    EXPECT_EQ(value.z, 0);
  }
}

TEST(Rgbd, KeepsWhatItsCodesHold) {
  EXPECT_EQ(encode_rgbd(one(1, 1, 1)).pixels, (std::vector<uint8_t>{255, 255, 255, 255}));
  EXPECT_EQ(encode_rgbd(one(255, 0, 0)).pixels, (std::vector<uint8_t>{255, 0, 0, 1}));
  EXPECT_EQ(encode_rgbd(one(0, 0, 0)).pixels, (std::vector<uint8_t>{0, 0, 0, 255}));
  EXPECT_EQ(encode_rgbd(one(0, 5, 5)).pixels, (std::vector<uint8_t>{0, 255, 255, 51}));
}

TEST(Rgbd, ReportsWhatItCutAndKeepsTheHue) {
  Image image(2, 1, 3);
  image.pixels = {510, 255, 0, 1, 1, 1};
  RgbdLoss loss;
  const Image8 packed = encode_rgbd(image, &loss);
  EXPECT_EQ(loss.cut, 1u);
  EXPECT_NEAR(loss.cut_off, 255 + 127.5, 1e-12);
  const Vec3d value = decode_rgbd(packed.pixels.data());
  EXPECT_EQ(value.x, 255);
  EXPECT_NEAR(value.y, 127.5, 0.006 * 127.5);
  RgbdLoss none;
  encode_rgbd(one(255, 200, 0.5), &none);
  EXPECT_EQ(none.cut, 0u);
  EXPECT_EQ(none.cut_off, 0);
}

TEST(Rgbd, MeasuresItsOwnError) {
  Image image(64, 64, 3);
  uint64_t state = 1;
  for (float& value : image.pixels) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    value = static_cast<float>(std::exp(static_cast<double>(state >> 40) * 0x1p-24 * 12 - 8));
  }
  RgbdLoss loss;
  const Image8 packed = encode_rgbd(image, &loss);
  double squares = 0, largest = 0;
  for (size_t i = 0; i < image.pixels.size() / 3; ++i) {
    const Vec3d value = decode_rgbd(&packed.pixels[4 * i]);
    for (int c = 0; c < 3; ++c) {
      const double error = value[c] - double{image.pixels[3 * i + static_cast<size_t>(c)]};
      squares += error * error;
      largest = std::max(largest, std::abs(error));
    }
  }
  EXPECT_NEAR(loss.rms, std::sqrt(squares / static_cast<double>(image.pixels.size())), 1e-12);
  EXPECT_EQ(loss.largest, largest);
  EXPECT_GT(loss.rms, 0);
}

TEST(Rgbd, IsWrittenWithItsDivisorInAlpha) {
  Image image(16, 16, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = 0.05f * static_cast<float>(i);
  const Image8 packed = encode_rgbd(image);
  EXPECT_EQ(read_ldr(write_png(packed)).pixels, packed.pixels);
}

}  // namespace
}  // namespace lightkiln

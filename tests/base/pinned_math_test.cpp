#include "core/base/pinned_math.h"

#include <bit>
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "core/base/math.h"
#include "core/base/random.h"

namespace lightkiln {
namespace {

double number(uint64_t i) {
  return static_cast<double>(hash64(i) >> 11) * 0x1p-53;
}

TEST(PinnedMath, AgreesWithTheCLibrary) {
  for (uint64_t i = 0; i < 100'000; ++i) {
    const double angle = 8 * kPi * (number(2 * i) - 0.5);
    const SinCos both = pinned_sin_cos(angle);
    ASSERT_NEAR(both.sin, std::sin(angle), 0x1p-52) << angle;
    ASSERT_NEAR(both.cos, std::cos(angle), 0x1p-52) << angle;
    const double x = number(2 * i) - 0.5, y = number(2 * i + 1) - 0.5;
    ASSERT_NEAR(pinned_atan2(y, x), std::atan2(y, x), 0x1p-51) << y << " " << x;
    ASSERT_NEAR(pinned_atan2(y * 1e-9, x), std::atan2(y * 1e-9, x), 0x1p-51);
  }
}

TEST(PinnedMath, AxesAreExact) {
  EXPECT_EQ(pinned_sin_cos(0).sin, 0);
  EXPECT_EQ(pinned_sin_cos(0).cos, 1);
  EXPECT_EQ(pinned_sin_cos(kPi / 2).sin, 1);
  EXPECT_EQ(pinned_sin_cos(kPi).cos, -1);
  EXPECT_EQ(pinned_atan2(0, 0), 0);
  EXPECT_EQ(pinned_atan2(0, 3), 0);
  EXPECT_EQ(pinned_atan2(0, -3), kPi);
  EXPECT_EQ(pinned_atan2(2, 0), kPi / 2);
  EXPECT_EQ(pinned_atan2(-2, 0), -kPi / 2);
  EXPECT_EQ(pinned_atan2(5, 5), kPi / 4);
}

// The very bits, whatever machine and C library this runs on.
TEST(PinnedMath, BitsAreTheSameEverywhere) {
  uint64_t hash = 0;
  for (uint64_t i = 0; i < 10'000; ++i) {
    const double a = 20 * number(2 * i) - 10, b = number(2 * i + 1) - 0.5;
    const SinCos both = pinned_sin_cos(a);
    for (const double value : {both.sin, both.cos, pinned_atan2(a, b)}) {
      hash = hash_combine(hash, std::bit_cast<uint64_t>(value));
    }
  }
  EXPECT_EQ(hash, 9217366234729981824ull);
}

}  // namespace
}  // namespace lightkiln

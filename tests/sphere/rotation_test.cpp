#include "core/sphere/rotation.h"

#include <cmath>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace lightkiln {
namespace {

TEST(Rotation, TurnsForwardToTheLeftByAPositiveYaw) {
  EXPECT_EQ(yaw_rotation(90).apply({0, 0, 1}), (Vec3d{1, 0, 0}));
  EXPECT_EQ(yaw_rotation(-90).apply({0, 0, 1}), (Vec3d{-1, 0, 0}));
  EXPECT_EQ(yaw_rotation(180).apply({0.5, 2, 1}), (Vec3d{-0.5, 2, -1}));
  EXPECT_TRUE(yaw_rotation(0).is_identity());
  EXPECT_TRUE(yaw_rotation(-720).is_identity());
  EXPECT_FALSE(yaw_rotation(1e-6).is_identity());
}

TEST(Rotation, TakesQuaternionsOfAnyLengthAndSign) {
  const double s = std::sqrt(0.5);
  for (const double scale : {1.0, -1.0, 1e-3, 700.0}) {
    const Vec3d d = quaternion_rotation(0, scale * s, 0, scale * s).apply({0, 0, 1});
    EXPECT_LT(length(d - Vec3d{1, 0, 0}), 1e-15);
  }
  EXPECT_TRUE(quaternion_rotation(0, 0, 0, 2).is_identity());
  EXPECT_TRUE(quaternion_rotation(0, 0, 0, -1).is_identity());
}

RC_GTEST_PROP(Rotation, KeepsLengthsHandednessAndUndoesItself, ()) {
  const auto number = rc::gen::map(rc::gen::inRange(-1000, 1001), [](int i) { return i * 1e-3; });
  const double x = *number, y = *number, z = *number, w = *number;
  RC_PRE(x * x + y * y + z * z + w * w > 1e-4);
  const Rotation r = quaternion_rotation(x, y, z, w);
  const Vec3d d{*number, *number, *number}, e{*number, *number, *number};
  RC_ASSERT(std::abs(length(r.apply(d)) - length(d)) < 1e-12);
  RC_ASSERT(length(r.undo(r.apply(d)) - d) < 1e-12);
  RC_ASSERT(length(cross(r.apply(d), r.apply(e)) - r.apply(cross(d, e))) < 1e-12);
  const double degrees = *rc::gen::inRange(-100000, 100000) * 0.01, half = degrees * kPi / 360;
  const Rotation yaw = yaw_rotation(degrees);
  const Rotation same = quaternion_rotation(0, std::sin(half), 0, std::cos(half));
  RC_ASSERT(length(yaw.apply(d) - same.apply(d)) < 1e-12);
}

}  // namespace
}  // namespace lightkiln

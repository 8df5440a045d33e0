// What people have as environment maps, ordered through the front door.

#include <span>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/ldr.h"
#include "tests/image/refusals.h"

namespace lightkiln {
namespace {

Image8 grey_picture(int width, int height, uint8_t code) {
  Image8 picture;
  picture.width = width;
  picture.height = height;
  picture.channels = 3;
  picture.pixels.assign(static_cast<size_t>(3 * width * height), code);
  return picture;
}

struct Order {
  Spec spec;
  std::vector<std::byte> file;
  Inputs inputs;

  explicit Order(std::vector<std::byte> bytes) : file(std::move(bytes)) {
    EnvironmentMapsParameters parameters;
    parameters.sh = ShOutput{1};
    spec.parameters = parameters;
    const std::string digest = "sha256:" + std::string(64, 'a');
    spec.environment = InputRef{digest, {}};
    inputs.blobs[digest] = file;
  }
};

TEST(EnvironmentInputs, APictureIsLightAndThePlanWarnsOfItsRange) {
  const Order order(write_png(grey_picture(8, 4, 188)));
  Bake bake(order.spec, order.inputs, {1, 0, 1});
  Progress progress;
  const Plan plan = bake.plan(progress);
  ASSERT_EQ(plan.warnings.size(), 1u);
  EXPECT_NE(plan.warnings[0].find("nothing in it is brighter than 1"), std::string::npos);
  const Assembly result = bake_all(order.spec, order.inputs, {1, 0, 1}, progress);
  const auto& document = std::get<EnvironmentDocument>(result.document);
  EXPECT_EQ(document.source_format, "PNG, 8-bit sRGB");
  EXPECT_NEAR(document.mean.x, srgb_to_linear(188), 1e-7);
}

TEST(EnvironmentInputs, APhotographIsRefusedByItsShape) {
  const Order order(write_png(grey_picture(12, 9, 100)));
  EXPECT_REFUSED(Bake(order.spec, order.inputs, {1, 0, 1}), invalid_input, "12 x 9 pixels");
}

TEST(EnvironmentInputs, ABlackMapIsBakedAndWarnedOf) {
  const Order order(write_png(grey_picture(8, 4, 0)));
  Bake bake(order.spec, order.inputs, {1, 0, 1});
  Progress progress;
  const Plan plan = bake.plan(progress);
  EXPECT_NE(plan.warnings.back().find("black"), std::string::npos);
}

}  // namespace
}  // namespace lightkiln

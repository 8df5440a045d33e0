// What people have as environment maps, ordered through the front door.

#include <array>
#include <functional>
#include <span>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/image/ldr.h"
#include "core/sphere/direction_map.h"
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

// An image of one colour per direction: what it shows can be told from any texel.
Vec3 colour_of(const Vec3d& d) {
  return {static_cast<float>(1 + d.x), static_cast<float>(1 + d.y), static_cast<float>(1 + d.z)};
}

constexpr int kSide = 8;

// Face `face` of a cube whose texel (x, y) looks along direction(face, s, t).
std::vector<std::byte> face_file(int face, int side,
                                 const std::function<Vec3d(int, double, double)>& direction) {
  Image image(side, side, 3);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const Vec3 colour = colour_of(normalize(direction(face, (x + 0.5) / side, (y + 0.5) / side)));
      std::copy_n(&colour.x, 3, image.at(x, y));
    }
  }
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  return write_exr(image, options);
}

// Table 8.19 of OpenGL 4.6 solved for the direction, then turned from the left-handed world
// (-x, y, z) into ours. Row 0 has t = 0.
Vec3d opengl_direction(int face, double s, double t) {
  const double sc = 2 * s - 1, tc = 2 * t - 1;
  const std::array<Vec3d, 6> theirs = {Vec3d{1, -tc, -sc}, Vec3d{-1, -tc, sc}, Vec3d{sc, 1, tc},
                                       Vec3d{sc, -1, -tc}, Vec3d{sc, -tc, 1},  Vec3d{-sc, -tc, -1}};
  const Vec3d& d = theirs[static_cast<size_t>(face)];
  return {-d.x, d.y, d.z};
}

struct SixFiles {
  Spec spec;
  std::array<std::vector<std::byte>, 6> files;
  Inputs inputs;

  explicit SixFiles(const std::function<Vec3d(int, double, double)>& direction) {
    EnvironmentMapsParameters parameters;
    constexpr auto kStrip = static_cast<size_t>(LayoutKind::cube_strip);
    parameters.layouts[kStrip] = default_layout_output(kStrip);
    parameters.layouts[kStrip]->size = kSide;
    spec.parameters = parameters;
    spec.environment.emplace();
    for (int face = 0; face < 6; ++face) {
      spec.environment->faces.push_back("sha256:" + std::string(64, static_cast<char>('a' + face)));
      give(face, face_file(face, kSide, direction));
    }
  }
  void give(int face, std::vector<std::byte> file) {
    const auto i = static_cast<size_t>(face);
    files[i] = std::move(file);
    inputs.blobs[spec.environment->faces[i]] = files[i];
  }
  SourceParameters& source() { return std::get<EnvironmentMapsParameters>(spec.parameters).source; }
};

// The largest difference between the strip that comes out and what its directions show.
double worst_difference(const SixFiles& order, std::string* format = nullptr) {
  Progress progress;
  const Assembly result = bake_all(order.spec, order.inputs, {1, 0, 1}, progress);
  const auto& document = std::get<EnvironmentDocument>(result.document);
  if (format) *format = document.source_format;
  for (const Artifact& artifact : result.artifacts) {
    if (artifact.name != "layout_cube_strip.exr") continue;
    const Image strip = read_exr(artifact.bytes).image;
    double worst = 0;
    for (int y = 0; y < 6 * kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const Vec3 seen = strip.rgb(x, y);
        const Vec3 truth = colour_of(cube_texel_direction(y / kSide, x, y % kSide, kSide));
        for (int c = 0; c < 3; ++c)
          worst = std::max(worst, std::abs(double{(&seen.x)[c]} - double{(&truth.x)[c]}));
      }
    }
    return worst;
  }
  ADD_FAILURE() << "There is no layout_cube_strip.exr.";
  return 1e9;
}

TEST(EnvironmentInputs, SixFilesAreTheCubeTheyShow) {
  const SixFiles order(cube_direction);
  std::string format;
  EXPECT_LT(worst_difference(order, &format), 1e-6);
  EXPECT_EQ(format.rfind("six files, OpenEXR", 0), 0u) << format;
}

TEST(EnvironmentInputs, SixFilesOfAGraphicsInterfaceAreTurnedIntoOurCube) {
  SixFiles order(opengl_direction);
  EXPECT_GT(worst_difference(order), 0.5);  // read as OpenEXR's
  order.source().face_orientation = FaceOrientation::opengl;
  EXPECT_LT(worst_difference(order), 1e-6);
}

TEST(EnvironmentInputs, AFaceThatDoesNotFitIsNamed) {
  SixFiles order(cube_direction);
  order.give(3, face_file(3, 2 * kSide, cube_direction));
  EXPECT_REFUSED(Bake(order.spec, order.inputs, {1, 0, 1}), invalid_input,
                 "The face ny is 16 x 16 pixels and px 8 x 8");
  order.give(3, write_png(grey_picture(8, 4, 10)));
  EXPECT_REFUSED(Bake(order.spec, order.inputs, {1, 0, 1}), invalid_input,
                 "The face ny is 8 x 4 pixels");
  order.give(0, write_png(grey_picture(8, 4, 10)));
  EXPECT_REFUSED(Bake(order.spec, order.inputs, {1, 0, 1}), invalid_input,
                 "The face px is 8 x 4 pixels; the six faces");
  order.give(0, write_png(grey_picture(2731, 2731, 10)));
  EXPECT_REFUSED(Bake(order.spec, order.inputs, {1, 0, 1}), too_large, "at most 2730 texels");
  order.give(0, face_file(0, kSide, cube_direction));
  order.give(3, std::vector<std::byte>(100));
  EXPECT_REFUSED(Bake(order.spec, order.inputs, {1, 0, 1}), invalid_input, "The face ny: ");
}

TEST(EnvironmentInputs, OnlyACubeOfPicturesIsCalledOne) {
  SixFiles order(cube_direction);
  const auto warnings = [&] {
    Progress progress;
    return Bake(order.spec, order.inputs, {1, 0, 1}).plan(progress).warnings.size();
  };
  for (int face = 0; face < 6; ++face) {
    EXPECT_EQ(warnings(), 0u) << face;
    order.give(face, write_png(grey_picture(kSide, kSide, static_cast<uint8_t>(90 + face))));
  }
  EXPECT_EQ(warnings(), 1u);
}

TEST(EnvironmentInputs, FacesAndOneFileAreNotMixed) {
  const auto pointers = [](const Spec& spec) {
    std::vector<std::string> found;
    for (const SpecFault& fault : validate(spec)) found.push_back(fault.pointer);
    return found;
  };
  using Pointers = std::vector<std::string>;
  SixFiles order(cube_direction);
  EXPECT_EQ(pointers(order.spec), Pointers{});
  order.source().layout = LayoutKind::octahedral;
  EXPECT_EQ(pointers(order.spec), Pointers{"/parameters/source/layout"});
  order.source().layout.reset();
  order.spec.environment->blob = order.spec.environment->faces[0];
  EXPECT_EQ(pointers(order.spec), Pointers{"/inputs/environment"});
  order.spec.environment->faces.clear();
  order.source().face_orientation = FaceOrientation::opengl;
  EXPECT_EQ(pointers(order.spec), Pointers{"/parameters/source/face_orientation"});
}

}  // namespace
}  // namespace lightkiln

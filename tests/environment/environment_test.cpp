#include "core/environment/environment.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/environment/brute_force.h"
#include "core/image/decode.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

DecodedImage decoded(const Image& image, EnvmapAttribute envmap = EnvmapAttribute::none) {
  DecodedImage result;
  result.image = image;
  result.envmap = envmap;
  return result;
}

// E1
TEST(Environment, CountsNanInfiniteAndNegativeByKind) {
  Image dirty = reference::test_sky(16, 10), clean = dirty;
  const float bad[] = {NAN, NAN, INFINITY, -INFINITY, -1.0f, -0.5f, -2.0f};
  for (int i = 0; i < 7; ++i) {
    dirty.at(i, 5)[i % 3] = bad[i];
    clean.at(i, 5)[i % 3] = 0;
  }
  const Environment a = make_environment(decoded(dirty)), b = make_environment(decoded(clean));
  EXPECT_EQ(a.repairs.nan, 2u);
  EXPECT_EQ(a.repairs.infinite, 2u);
  EXPECT_EQ(a.repairs.negative, 3u);
  EXPECT_EQ(a.radiance.pixels, b.radiance.pixels);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_TRUE(std::isfinite(a.mean.x));
  // Positive control: left in the map, one such texel takes every coefficient along.
  Environment poisoned = b;
  *poisoned.radiance.at(3, 5) = NAN;
  for (const int l : {0, 3}) {
    EXPECT_TRUE(std::isfinite(projected_coefficient(b, l, 0).x));
    EXPECT_FALSE(std::isfinite(projected_coefficient(poisoned, l, 0).x));
  }
}

// E6: the closed form of a lit pole row is its cap.
TEST(Environment, WeighsAPoleRowByItsCap) {
  const int height = 16;
  Image map(2 * height, height, 3);
  std::fill_n(map.at(0, 0), 3 * 2 * height, 1e4f);
  const double cap = 1e4 * (1 - std::cos(kPi / height)) / 2;
  EXPECT_NEAR(make_environment(decoded(map)).mean.x / cap, 1, 1e-6);
  // Positive control: the area that the sine at the row's centre gives.
  EXPECT_GT(std::abs(1e4 * kPi / height * std::sin(kPi / (2 * height)) / 2 / cap - 1), 1e-3);
}

TEST(Environment, RefusesThemWithTheirCountsWhenStrict) {
  Image dirty = reference::test_sky(16, 10);
  const SourceReading strict{.strict = true};
  EXPECT_NO_THROW(make_environment(decoded(dirty), strict));
  dirty.at(1, 5)[0] = dirty.at(2, 5)[1] = NAN;
  dirty.at(3, 5)[2] = -INFINITY;
  for (int i = 4; i < 7; ++i) dirty.at(i, 5)[0] = -1e-6f;
  EXPECT_NO_THROW(make_environment(decoded(dirty)));
  try {
    make_environment(decoded(dirty), strict);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_input);
    EXPECT_NE(std::string(error.what()).find("2 NaN, 1 infinite and 3 negative"), std::string::npos)
        << error.what();
  }
}

TEST(Environment, KnowsAConstantMapAndItsMean) {
  Image map(8, 4, 3);
  for (float& v : map.pixels) v = 0.7f;
  const Environment environment = make_environment(decoded(map));
  EXPECT_TRUE(environment.constant);
  EXPECT_EQ(environment.mean.y, double(0.7f));
  map.at(5, 2)[0] = 0.8f;
  EXPECT_FALSE(make_environment(decoded(map)).constant);
}

TEST(Environment, MeansWithTrueSolidAngles) {
  Image map(64, 32, 3);
  for (int x = 0; x < 64; ++x) map.at(x, 0)[0] = 100;  // a bright pole row
  const Environment environment = make_environment(decoded(map));
  EXPECT_NEAR(environment.mean.x, 100 * cap_solid_angle(kPi / 32) / (4 * kPi), 1e-12);
  EXPECT_GT(100.0 / 32, 10 * environment.mean.x);  // what counting texels alike would give
}

TEST(Environment, TakesOneChannelAsGrey) {
  Image grey(4, 2, 1);
  grey.at(1, 1)[0] = 3;
  const Environment environment = make_environment(decoded(grey));
  EXPECT_EQ(environment.radiance.rgb(1, 1), (Vec3{3, 3, 3}));
}

std::string refusal(const DecodedImage& image, const SourceReading& reading = {}) {
  try {
    make_environment(image, reading);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_input);
    return error.what();
  }
  return "";
}

TEST(Environment, RefusesPhotographsAndNamesWhatIsAllowed) {
  for (const auto& image : {Image(300, 200, 3), Image(400, 300, 3), Image(2, 2, 3)}) {
    const std::string sentence = refusal(decoded(image));
    EXPECT_NE(sentence.find("twice as wide"), std::string::npos);
    EXPECT_NE(sentence.find("horizontal_cross (4N x 3N)"), std::string::npos);
  }
  const SourceReading cross{.layout = LayoutKind::horizontal_cross};
  EXPECT_NE(refusal(decoded(Image(400, 200, 3)), cross).find("4N x 3N"), std::string::npos);
  EXPECT_EQ(refusal(decoded(Image(400, 300, 3)), cross), "");
  const SourceReading borders{.layout = LayoutKind::octahedral,
                              .convention = TexelConvention::openexr};
  EXPECT_NE(refusal(decoded(Image(64, 64, 3)), borders).find("cube strips only"),
            std::string::npos);
  // A cube that says so needs no word from the client; one of the wrong shape is refused.
  EXPECT_EQ(refusal(decoded(Image(16, 96, 3), EnvmapAttribute::cube)), "");
  EXPECT_NE(refusal(decoded(Image(16, 32, 3), EnvmapAttribute::cube)).find("N x 6N"),
            std::string::npos);
}

TEST(Environment, LooksUpTheTexelThatHoldsADirection) {
  Image map(8, 4, 3);
  for (size_t i = 0; i < map.pixels.size(); ++i) map.pixels[i] = float(i);
  const Environment environment = make_environment(decoded(map));
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      for (const double f : {0.001, 0.5, 0.999}) {
        const Vec3d d = latlong_direction((x + f) / 8, (y + f) / 4);
        EXPECT_EQ(environment_radiance(environment, to_float(d)), map.rgb(x, y));
      }
    }
  }
  EXPECT_EQ(environment_radiance(environment, {0, 1, 0}).x, map.rgb(4, 0).x);
  EXPECT_EQ(environment_radiance(constant_environment({1, 2, 3}), {0, -1, 0}), (Vec3{1, 2, 3}));
}

// A file that says envmap = latlong has its outer pixel centres on the borders. A linear ramp in
// latitude and a bump in longitude keep their place only when that is heeded.
TEST(Environment, HeedsTexelsOnTheBorder) {
  Image map(64, 32, 3);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      map.at(x, y)[0] = static_cast<float>(y / 31.0);
      map.at(x, y)[1] = static_cast<float>(1 + std::cos(2 * kPi * x / 63.0));
    }
  }
  const auto worst = [](const Environment& environment) {
    const Image& image = environment.radiance;
    double result = 0;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const double v = (y + 0.5) / image.height, u = (x + 0.5) / image.width;
        const Vec3 a = image.rgb(x, y);
        result = std::max({result, std::abs(a.x - v), std::abs(a.y - 1 - std::cos(2 * kPi * u))});
      }
    }
    return result;
  };
  const Environment heeded = make_environment(decoded(map, EnvmapAttribute::latlong));
  EXPECT_EQ(heeded.radiance.width, 128);  // twice as fine: their samples fall between ours
  // The mean over a polar texel of height h = 1/64 is not its centre's value: by solid angle its
  // middle lies at 2/3 h, h/6 further, and weights that keep energy there (RowBlend, k up to 1/2)
  // move up to k/4 of a row of 1/31: 0.0026 + 0.0040.
  EXPECT_LT(worst(heeded), 6.6e-3);
  EXPECT_GT(worst(make_environment(decoded(map))), 1e-2);
  // What a client says goes before what the file says.
  const SourceReading reading{.convention = TexelConvention::half_texel};
  EXPECT_EQ(make_environment(decoded(map, EnvmapAttribute::latlong), reading).radiance.pixels,
            map.pixels);
}

// Half of the sphere, and how much of it is not there.
// Relative to the mean or to what a texel shows, whichever is more, as bounds of conversions are.
double rms_between(const Environment& a, const Environment& b) {
  const double mean = luminance(b.mean);
  double sum = 0;
  for (size_t i = 0; i < a.radiance.pixels.size(); ++i) {
    const double shown = std::max(mean, double(b.radiance.pixels[i]));
    sum += std::pow((double(a.radiance.pixels[i]) - double(b.radiance.pixels[i])) / shown, 2);
  }
  return std::sqrt(sum / static_cast<double>(a.radiance.pixels.size()));
}

TEST(Environment, IsBroughtToALatLongAsExactlyAsItIsRead) {
  Image strip(24, 144, 3);
  for (size_t i = 0; i < strip.pixels.size(); ++i)
    strip.pixels[i] = 0.5f + static_cast<float>(i * 7919 % 101) / 101;
  SourceReading reading;
  reading.layout = LayoutKind::cube_strip;
  const auto read_to = [&](double error) {
    reading.conversion_error = error;
    return make_environment(decoded(strip), reading);
  };
  const Environment truth = read_to(1e-6), exact = read_to(1e-4), usual = read_to(1e-3);
  EXPECT_EQ(exact.conversion_error, 1e-4);
  EXPECT_LE(rms_between(exact, truth), 1e-4);
  EXPECT_LE(rms_between(usual, truth), 1e-3);
  // Positive control: the usual one would not pass for the exact one.
  EXPECT_GT(rms_between(usual, truth), 1e-4);
  EXPECT_EQ(make_environment(decoded(reference::test_sky(16, 10))).conversion_error, 0);
}

TEST(Environment, LeavesBlackWhatTheSourceDoesNotCover) {
  Image dome(64, 64, 3);
  for (float& v : dome.pixels) v = 2;
  const Environment environment =
      make_environment(decoded(dome), {.layout = LayoutKind::hemisphere});
  EXPECT_NEAR(environment.covered_share, 0.5, 1e-12);
  EXPECT_EQ(environment.radiance.width, 256);
  EXPECT_NEAR(environment.mean.x, 1, 1e-6);
  EXPECT_EQ(environment_radiance(environment, {0, 0.1f, 0.99f}), (Vec3{2, 2, 2}));
  EXPECT_EQ(environment_radiance(environment, {0, -0.1f, 0.99f}), (Vec3{0, 0, 0}));
}

TEST(Environment, TurnsBySteppingColumnsWhereItCan) {
  const Image map = reference::test_sky(32, 6);
  const Environment still = make_environment(decoded(map), {}, yaw_rotation(360));
  EXPECT_EQ(still.radiance.pixels, map.pixels);
  EXPECT_TRUE(still.source.pixels.empty());
  const Environment turned = make_environment(decoded(map), {}, yaw_rotation(90));
  EXPECT_EQ(turned.radiance.width, map.width);
  EXPECT_EQ(environment_radiance(turned, {0.99f, 0.1f, 0.05f}),
            environment_radiance(still, {-0.05f, 0.1f, 0.99f}));
  EXPECT_NEAR(turned.mean.y / still.mean.y, 1, 1e-12);
  EXPECT_EQ(make_environment(decoded(map), {}, yaw_rotation(50)).radiance.width, 2 * map.width);
}

TEST(Environment, OpensEveryLatLongOfTheDataSet) {
  LIGHTKILN_NEEDS_DATA(data);
  int opened = 0;
  for (const char* folder : {"latlong_hdr", "latlong_exr", "furnace"}) {
    for (const auto& entry : std::filesystem::directory_iterator(data / "environments" / folder)) {
      const Environment environment =
          make_environment(decode_hdr_image(test::read_file(entry.path())));
      EXPECT_GT(luminance(environment.mean), 0) << entry.path();
      EXPECT_EQ(environment.constant, std::string(folder) == "furnace") << entry.path();
      ++opened;
    }
  }
  EXPECT_EQ(opened, 13);
}

}  // namespace
}  // namespace lightkiln

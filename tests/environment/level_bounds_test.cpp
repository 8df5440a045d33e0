// What a level states of itself before it is made, against the twin over the whole sphere.

#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "core/environment/bright_light.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"
#include "tests/environment/convolved.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

using test::environment_of;

struct NamedMap {
  std::string name;
  Image image;
};

Image even_map(int height, const Vec3& value) {
  Image map(2 * height, height, 3);
  for (size_t i = 0; i < map.pixels.size(); i += 3) std::copy_n(&value.x, 3, &map.pixels[i]);
  return map;
}

// Maps whose texels are large, so that all that is small elsewhere counts: suns of one texel, at
// both poles, and blue, whose luminance is a fourteenth of its radiance; noise; lights of all
// sizes.
std::vector<NamedMap> hard_maps() {
  std::vector<NamedMap> maps = {
      {"sky", reference::test_sky(24, 100)},          {"sun", reference::test_sky(8, 1e5)},
      {"one", even_map(8, {0.2f, 0.2f, 0.2f})},       {"poles", even_map(8, {0.2f, 0.2f, 0.2f})},
      {"blue", even_map(12, {0.2f, 0.2f, 0.2f})},     {"lights", even_map(16, {0, 0, 0})},
      {"small sun", even_map(32, {0.2f, 0.2f, 0.2f})}};
  for (size_t c = 0; c < 3; ++c) {
    maps[2].image.at(2, 2)[c] = 1e6f;
    maps[3].image.at(2, 0)[c] = 1e6f;
    maps[3].image.at(3, 7)[c] = 3e5f;
    maps[6].image.at(10, 8)[c] = 1e6f;
  }
  maps[4].image.at(5, 3)[2] = 1e5f;
  uint32_t state = 3;
  for (float& v : maps[5].image.pixels) {
    state = state * 1664525u + 1013904223u;
    v = static_cast<float>(1e4 * std::pow((state >> 8) * 0x1p-24, 30));
  }
  return maps;
}

struct Truth {
  int size;
  LobeAverages averages;
};
Truth truth_of(const Environment& sky, const Lobe& lobe, int size) {
  std::vector<Vec3d> directions;
  for (int y = 0; y < 6 * size; ++y) {
    for (int x = 0; x < size; ++x)
      directions.push_back(cube_texel_direction(y / size, x, y % size, size));
  }
  Progress progress;
  return {size, lobe_averages(sky, *make_twin_lobe(lobe), directions, 1, progress)};
}

// Root mean square over the sphere of the error of the channel where it is largest, relative to the
// mean.
double rms_error(const Image& cube, const Truth& truth, double mean) {
  Vec3d squares;
  for (size_t i = 0; i < truth.averages.means.size(); ++i) {
    const int x = static_cast<int>(i) % truth.size, y = static_cast<int>(i) / truth.size;
    const Vec3d error = to_double(cube.rgb(x, y)) - truth.averages.means[i];
    squares += error * error * cube_texel_solid_angle(x, y % truth.size, truth.size);
  }
  return std::sqrt(std::max({squares.x, squares.y, squares.z}) / (4 * kPi)) / mean;
}

// Root mean square of what the twin itself may err by.
double twin_error(const Truth& truth, const Environment& sky) {
  double squares = 0;
  for (const Vec3d& mean : truth.averages.means)
    squares += std::pow(std::max({mean.x, mean.y, mean.z}), 2);
  return kTwinError * std::sqrt(squares / static_cast<double>(truth.averages.means.size())) +
         kTwinEmpty * std::max({sky.mean.x, sky.mean.y, sky.mean.z});
}

// No level errs by more than it states, however large its texels, however bright and wherever its
// suns, at any order. Positive control: without the closed form that suns are corrected by, most of
// those that rest on it do.
TEST(LevelBounds, HoldOverTheWholeSphere) {
  int corrected = 0, broken = 0;
  for (const NamedMap& map : hard_maps()) {
    const Environment sky = environment_of(map.image);
    const LightStatistics light = measure_light(sky);
    for (const Lobe& lobe : {Lobe{LobeKind::ggx, 0.0324},
                             {LobeKind::ggx, 0.0625},
                             {LobeKind::ggx, 0.25},
                             {LobeKind::ggx, 0.5625},
                             {LobeKind::ggx, 1},
                             {LobeKind::charlie, 0.0625},
                             {LobeKind::charlie, 0.25},
                             {LobeKind::charlie, 0.5625},
                             {LobeKind::charlie, 1}}) {
      const Truth truth = truth_of(sky, lobe, 4);
      const double twin = twin_error(truth, sky) / light.mean_luminance;
      for (const double target : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
        LobePlan plan = plan_lobe(light, lobe, target);
        if (plan.bands > 320) continue;  // for the time they take
        const auto where = [&] {
          return map.name + (lobe.kind == LobeKind::ggx ? " GGX " : " Charlie ") +
                 std::to_string(lobe.alpha) + " at " + std::to_string(target);
        };
        const double seen =
            rms_error(test::convolve(sky, plan, truth.size).cube, truth, light.mean_luminance);
        EXPECT_LE(seen, plan.error_bound + twin) << where();
        if (!plan.corrected) continue;
        ++corrected;
        plan.corrected = false;
        const double bare =
            rms_error(test::convolve(sky, plan, truth.size).cube, truth, light.mean_luminance);
        broken += bare > plan.error_bound + twin;
      }
    }
  }
  EXPECT_GT(corrected, 50);
  EXPECT_GT(broken, corrected / 2);
}

// Real skies, one with an unclipped sun, at the usual order: every level within its bound, texels
// within a thousandth of themselves, none negative. Positive control: half of the bands are not
// enough for that.
TEST(LevelBounds, HoldForRealSkies) {
  LIGHTKILN_NEEDS_DATA(data);
  constexpr int kTexels = 40, kSize = 64;
  constexpr double kTarget = 1e-4;  // a tenth of the order
  for (const char* name : {"kloppenheim_05_1k.hdr", "spiaggia_di_mondello_1k.hdr"}) {
    const Environment sky = make_environment(
        decode_hdr_image(test::read_file(data / "environments" / "latlong_hdr" / name)));
    const LightStatistics light = measure_light(sky);
    for (const Lobe& lobe : {Lobe{LobeKind::ggx, 0.0625},
                             {LobeKind::ggx, 0.25},
                             {LobeKind::ggx, 0.5625},
                             {LobeKind::ggx, 1},
                             {LobeKind::charlie, 0.0625},
                             {LobeKind::charlie, 1}}) {
      LobePlan plan = plan_lobe(light, lobe, kTarget);
      EXPECT_LE(plan.error_bound, 1.5 * kTarget) << name;
      std::vector<std::pair<int, int>> places;
      std::vector<Vec3d> directions;
      for (int i = 0; i < kTexels; ++i) {
        const int texel = (i * 7919 + 13) % (6 * kSize * kSize), x = texel % kSize;
        const int line = texel / kSize;
        places.push_back({x, line});
        directions.push_back(cube_texel_direction(line / kSize, x, line % kSize, kSize));
      }
      Progress progress;
      const LobeAverages truth = lobe_averages(sky, *make_twin_lobe(lobe), directions, 2, progress);
      const auto compare = [&](const Image& cube, double* worst) {
        double squares = 0;
        for (size_t i = 0; i < places.size(); ++i) {
          double most = 0;
          for (int c = 0; c < 3; ++c) {
            const double value = double(cube.at(places[i].first, places[i].second)[c]);
            EXPECT_GE(value, 0);
            most = std::max(most, std::abs(value - truth.means[i][c]));
            *worst = std::max(*worst, std::abs(value / truth.means[i][c] - 1));
          }
          squares += most * most;
        }
        return std::sqrt(squares / kTexels) / light.mean_luminance;
      };
      double worst = 0, bare_worst = 0;
      const double seen = compare(test::convolve(sky, plan, kSize).cube, &worst);
      EXPECT_LE(seen, plan.error_bound) << name << " " << lobe.alpha;
      EXPECT_LE(worst, 1e-3) << name << " " << lobe.alpha;
      plan.bands /= 2;
      plan.responses.resize(static_cast<size_t>(plan.bands));
      plan.corrected = false;
      const double bare = compare(test::convolve(sky, plan, kSize).cube, &bare_worst);
      EXPECT_GT(bare, plan.error_bound) << name << " " << lobe.alpha;
      EXPECT_GT(bare_worst, 1e-3) << name << " " << lobe.alpha;
    }
  }
}

// A level of one band alone is the mean: on the tallest rows its sine alone asks for points.
TEST(LevelBounds, CountTheMeanOfFewRows) {
  for (const int height : {2, 4, 8}) {
    const Environment sky = environment_of(reference::test_sky(height, 300));
    LobePlan plan;
    plan.responses = {1};
    plan.row_error = 1e-6;
    Progress progress;
    const LatlongSpectrum spectrum = project_for(sky, {&plan, 1}, {}, 1, progress);
    const double mean = spectrum.coefficients[spectrum.offset(0, 0)] / std::sqrt(4 * kPi);
    EXPECT_NEAR(mean / sky.mean.x, 1, plan.row_error) << height;
    // Positive control: a point a row.
    const LatlongSpectrum rough = project_latlong(sky.radiance, 1, 1, 1, progress);
    const double off = rough.coefficients[rough.offset(0, 0)] / std::sqrt(4 * kPi) / sky.mean.x;
    EXPECT_GT(std::abs(off - 1), 1e-3) << height;
  }
}

// A sun of any shape on the sphere sends as much light as it holds, to any side: the corrected part
// alone, over a kernel that is all kink, against the cosine's closed form for texels.
TEST(CutLight, HasTheMeanDirectionOfEachTexel) {
  for (const int row : {0, 1, 3, 6, 7}) {
    Image map = even_map(8, {1e-3f, 1e-3f, 1e-3f});
    for (int c = 0; c < 3; ++c) map.at(5, row)[c] = 1e4f;
    const LightStatistics light = measure_light(environment_of(map));
    ASSERT_EQ(light.bright.size(), 1u);
    const auto kernel = make_kernel({LobeKind::ggx, 1});
    const std::vector<double> responses = band_responses(*kernel, 1);
    const CutLight cut(light, *kernel, responses, 64);
    const Vec3d moment = latlong_texel_moment(5, row, 16, 8);
    const double omega = latlong_texel_solid_angle(row, 16, 8);
    for (const Vec3d& axis : {normalize(moment), normalize(moment + Vec3d{0.3, 0.2, -0.1} * omega),
                              normalize(moment + Vec3d{-0.1, -0.4, 0.2} * omega)}) {
      // All of the texel is above the horizon.
      const double truth = 1e4 * (dot(moment, axis) / kPi - omega * responses[0] / (4 * kPi));
      EXPECT_NEAR(cut.at(axis).x / truth, 1, 2e-5) << row;
    }
  }
}

}  // namespace
}  // namespace lightkiln

#include "core/environment/layout_truth.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/environment/polygon_coverage.h"

namespace lightkiln {
namespace {

// White noise, which no picture is as hard as.
Image noise(const MapLayout& layout) {
  Image image(layout.width, layout.height, 3);
  uint32_t state = 1;
  for (float& value : image.pixels) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state >> 8) * 0x1p-23f;
  }
  return image;
}

Image convert(const MapLayout& from, const Image& source, const MapLayout& to, double error,
              MapFilter filter = MapFilter::adaptive, const Rotation& turn = {}) {
  Progress progress;
  return convert_layout(ConversionSource(from, source), to, turn, filter, error, 2, progress);
}

struct Pair {
  MapLayout from, to;
};
// Shrinking, about equal, and enlarging.
std::vector<Pair> pairs() {
  std::vector<Pair> pairs;
  for (const auto& [a, b] : {std::pair{LayoutKind::latlong, LayoutKind::octahedral},
                             {LayoutKind::latlong, LayoutKind::horizontal_cross},
                             {LayoutKind::latlong, LayoutKind::hemisphere},
                             {LayoutKind::cube_strip, LayoutKind::latlong},
                             {LayoutKind::octahedral, LayoutKind::cylinder},
                             {LayoutKind::equal_area_octahedral, LayoutKind::vertical_cross},
                             {LayoutKind::latlong, LayoutKind::mirror_ball},
                             {LayoutKind::latlong, LayoutKind::angular},
                             {LayoutKind::cube_strip, LayoutKind::hemisphere_equal_area},
                             {LayoutKind::octahedral, LayoutKind::mirror_ball},
                             {LayoutKind::angular, LayoutKind::latlong}}) {
    for (const int size : {32, 72, 160}) {
      const auto sized = [](LayoutKind kind, int n) {
        return make_layout(kind, is_cube(kind) ? n / 2 : kind == LayoutKind::latlong ? 2 * n : n);
      };
      pairs.push_back({sized(a, 64), sized(b, size)});
    }
  }
  return pairs;
}

// Root mean square over texels spread over the target, by the rule of convert_layout().
double measure(const Pair& pair, const Image& source, const Image& image, MapFilter filter,
               const Rotation& turn = {}, double* largest = nullptr) {
  const ConversionSource summary(pair.from, source);
  double squares = 0;
  int count = 0;
  for (int i = 0; count < 24; ++i) {
    const double u = 0.5 + i * 0.7548776662466927, v = 0.5 + i * 0.5698402909980532;
    const int x = static_cast<int>((u - std::floor(u)) * pair.to.width);
    const int y = static_cast<int>((v - std::floor(v)) * pair.to.height);
    if (!texel_has_direction(pair.to, x, y)) continue;
    const LayoutTruth truth = layout_truth(pair.from, source, pair.to, turn, filter, x, y);
    const double scale = std::max(summary.mean, truth.brightest);
    const Vec3d error = (to_double(image.rgb(x, y)) - truth.radiance) / scale;
    const double most = std::max({std::abs(error.x), std::abs(error.y), std::abs(error.z)});
    if (largest != nullptr) *largest = std::max(*largest, most);
    squares += most * most;
    ++count;
  }
  return std::sqrt(squares / count);
}

// The twin itself against 300 x 300 points.
TEST(LayoutTruth, AgreesWithASumOfPoints) {
  for (const Pair& pair : pairs()) {
    const Image source = noise(pair.from);
    const RowBlend blend(pair.from);
    const int x = pair.to.width / 3, y = pair.to.height * 2 / 5;
    if (!texel_has_direction(pair.to, x, y)) continue;
    for (const MapFilter filter : {MapFilter::area, MapFilter::adaptive}) {
      // What is enlarged twice or more is interpolated everywhere, and nowhere else is it at all.
      if (filter == MapFilter::adaptive && pair.to.width * pair.to.height < 160 * 160) continue;
      if (filter == MapFilter::adaptive && pair.to.kind != LayoutKind::octahedral) continue;
      constexpr int kSide = 300;
      Vec3d energy;
      double omega = 0;
      for (int k = 0; k < kSide * kSide; ++k) {
        const double px = x + (k % kSide + 0.5) / kSide, py = y + (k / kSide + 0.5) / kSide;
        const auto d = layout_direction(pair.to, px, py);
        const auto place = d ? layout_place(pair.from, *d) : std::nullopt;
        if (!place) continue;
        const double weight = solid_angle_density(pair.to, px, py);
        energy += (filter == MapFilter::area ? nearest_radiance(pair.from, source, *place)
                                             : smooth_radiance(pair.from, source, *place, blend)) *
                  weight;
        omega += weight;
      }
      const Vec3d truth =
          layout_truth(pair.from, source, pair.to, Rotation{}, filter, x, y, 200).radiance;
      EXPECT_LT(length(truth - energy / omega), 3e-3)
          << layout_name(pair.from.kind) << " to " << layout_name(pair.to.kind);
    }
  }
}

// The promise of convert_layout() on the hardest picture; a tighter order errs less.
TEST(LayoutTruth, HoldsEveryConversionToItsOrder) {
  const Rotation turn = quaternion_rotation(0.3, -0.5, 0.2, 0.7);
  double loose_sum = 0, tight_sum = 0;
  size_t k = 0;
  for (const Pair& pair : pairs()) {
    const Image source = noise(pair.from);
    const Rotation& rotation = ++k % 2 == 0 ? turn : Rotation{};
    const MapFilter filter = k % 5 == 0 ? MapFilter::area : MapFilter::adaptive;
    for (const double error : {1e-2, 1e-3}) {
      const Image image = convert(pair.from, source, pair.to, error, filter, rotation);
      const double found = measure(pair, source, image, filter, rotation);
      EXPECT_LT(found, error)
          << layout_name(pair.from.kind) << " to " << layout_name(pair.to.kind) << " "
          << pair.to.width << ": " << found;
      (error == 1e-2 ? loose_sum : tight_sum) += found;
    }
  }
  EXPECT_LT(tight_sum, 0.5 * loose_sum);
}

struct Share {
  Vec3d energy;
  double omega = 0;
};

// What a texel at the rim of a disc shows, by midpoints in polar coordinates of the disc, with the
// radius r = 1 - (1 - u)^2 (1 - inner radius): dense where the direction moves fastest.
Vec3d polar_sum(const Pair& pair, const Image& source, int x, int y) {
  constexpr int kAngles = 400, kRadii = 800;
  const RowBlend blend(pair.from);
  const double half = 0.5 * pair.to.width;
  const auto place = [&](double px, double py) -> std::optional<MapPlace> {
    const auto d = layout_direction(pair.to, px, py);
    return d ? layout_place(pair.from, *d) : std::nullopt;
  };
  // Texels of the source along a side of the target's.
  const auto slope = [&](const MapPlace& here, double px, double py, double dx, double dy) {
    GridPoint sum;
    int sides = 0;
    for (const double step : {1e-6, -1e-6}) {
      const auto there = place(px + step * dx, py + step * dy);
      if (!there) continue;
      const double turn = pair.from.width;
      sum.x += (there->x - here.x - turn * std::nearbyint((there->x - here.x) / turn)) / step;
      sum.y += (there->y - here.y) / step;
      ++sides;
    }
    return GridPoint{sum.x / sides, sum.y / sides};
  };
  Share sum;
  const double middle = std::atan2(y + 0.5 - half, x + 0.5 - half), reach = 0.75 / (half - 1);
  for (int i = 0; i < kAngles; ++i) {
    const double phi = middle + reach * (2 * (i + 0.5) / kAngles - 1);
    const double c = std::cos(phi), s = std::sin(phi);
    const double inner = half - 2.3;
    for (int j = 0; j < kRadii; ++j) {
      const double u = (j + 0.5) / kRadii, r = half - (half - inner) * (1 - u) * (1 - u);
      const double px = half + r * c, py = half + r * s;
      if (px < x || px >= x + 1 || py < y || py >= y + 1) continue;
      const auto q = place(px, py);
      const double omega = solid_angle_density(pair.to, px, py) * r * (1 - u);
      const GridPoint a = slope(*q, px, py, 1, 0), b = slope(*q, px, py, 0, 1);
      const double trace = a.x * a.x + a.y * a.y + b.x * b.x + b.y * b.y;
      const double det = a.x * b.y - a.y * b.x;
      const double larger = (trace + std::sqrt(std::max(0.0, trace * trace - 4 * det * det))) / 2;
      const double share = std::clamp(2 - 2 * std::abs(det) / std::sqrt(larger), 0.0, 1.0);
      sum.energy += (nearest_radiance(pair.from, source, *q) * (1 - share) +
                     smooth_radiance(pair.from, source, *q, blend) * share) *
                    omega;
      sum.omega += omega;
    }
  }
  return sum.energy / sum.omega;
}

// Twin and conversion, texel by texel, where one texel may show many degrees and the rim cuts it.
// Lines and cells in the image's own coordinates, there and back, were off by 0.01 to 0.1.
TEST(LayoutTruth, HoldsAtRoundRims) {
  for (const LayoutKind kind :
       {LayoutKind::mirror_ball, LayoutKind::mirror_ball, LayoutKind::angular,
        LayoutKind::hemisphere, LayoutKind::hemisphere_equal_area}) {
    static int balls = 0;
    Pair pair{make_layout(LayoutKind::latlong, 128), make_layout(kind, 64)};
    if (kind == LayoutKind::mirror_ball && ++balls == 2) pair.to.camera_distance = 3;
    const Image source = noise(pair.from);
    const Image image = convert(pair.from, source, pair.to, 1e-3);
    int texels = 0;
    for (int i = 0; texels < 6; ++i) {
      const int x = i * 29 % 64, y = i * 53 % 64;
      const double r = std::hypot(x + 0.5 - 32, y + 0.5 - 32);
      if (r > 32 || r < 30.7) continue;
      ++texels;
      const Vec3d sum = polar_sum(pair, source, x, y);
      const LayoutTruth truth =
          layout_truth(pair.from, source, pair.to, Rotation{}, MapFilter::adaptive, x, y);
      const std::string where =
          std::string(layout_name(kind)) + " " + std::to_string(x) + "," + std::to_string(y);
      EXPECT_LT(length(truth.radiance - sum), 1e-3) << where;
      EXPECT_LT(length(to_double(image.rgb(x, y)) - sum) / truth.brightest, 3e-3) << where;
    }
  }
}

// What the check is for: a conversion that is turned by a quarter of a texel is seen at once.
TEST(LayoutTruth, SeesAConversionThatIsOff) {
  size_t k = 0;
  for (const Pair& pair : pairs()) {
    if (pair.to.width < 64 || ++k % 3 != 0) continue;
    const Image source = noise(pair.from);
    const Image right = convert(pair.from, source, pair.to, 1e-3);
    const Image shifted = convert(pair.from, source, pair.to, 1e-3, MapFilter::adaptive,
                                  yaw_rotation(0.25 * 360 / 128));
    const double found = measure(pair, source, right, MapFilter::adaptive);
    const double off = measure(pair, source, shifted, MapFilter::adaptive);
    EXPECT_GT(off, 10 * found) << layout_name(pair.from.kind) << " to " << layout_name(pair.to.kind)
                               << " " << pair.to.width;
    EXPECT_GT(off, 1e-2);
  }
}

double integral(const MapLayout& layout, const Image& image) {
  double sum = 0;
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      int i = x, j = y;
      find_value(layout, &i, &j);
      sum += texel_solid_angle(layout, x, y) * double(image.at(i, j)[1]);
    }
  }
  return sum;
}

struct Lamp {
  LayoutKind kind;
  int size, x, y;
  double most;  // of its light that may be gained or lost when it is enlarged
};
// At the pole and the seam of a lat-long map, at corners and edges of cubes and octahedra, at the
// rim of discs.
const Lamp kLamps[] = {
    {LayoutKind::latlong, 32, 5, 0, 0.01},
    {LayoutKind::latlong, 32, 20, 15, 0.01},
    {LayoutKind::latlong, 32, 5, 1, 0.01},
    {LayoutKind::latlong, 32, 0, 7, 0.01},
    {LayoutKind::cube_strip, 16, 0, 0, 0.03},
    {LayoutKind::cube_strip, 16, 15, 40, 0.03},
    {LayoutKind::cube_strip, 16, 8, 40, 0.01},
    {LayoutKind::octahedral, 24, 0, 0, 0.03},
    {LayoutKind::octahedral, 24, 0, 11, 0.03},
    {LayoutKind::octahedral, 24, 12, 12, 0.03},
    {LayoutKind::equal_area_octahedral, 24, 0, 0, 0.01},
    {LayoutKind::equal_area_octahedral, 24, 12, 12, 0.01},
    {LayoutKind::cylinder_equal_area, 32, 3, 0, 0.02},
    {LayoutKind::angular, 32, 9, 15, 0.01},
    {LayoutKind::mirror_ball, 32, 9, 15, 0.01},
};

TEST(LampsOfOneTexel, KeepTheirLightWhenEnlarged) {
  for (const Lamp& lamp : kLamps) {
    const MapLayout from = make_layout(lamp.kind, lamp.size);
    Image source(from.width, from.height, 3);
    source.at(lamp.x, lamp.y)[1] = 1000;
    const double before = integral(from, source);
    for (const MapLayout& to : {make_layout(LayoutKind::equal_area_octahedral, 200),
                                make_layout(LayoutKind::latlong, 400)}) {
      const double after = integral(to, convert(from, source, to, 1e-3));
      EXPECT_NEAR(after / before, 1, lamp.most) << layout_name(lamp.kind) << " " << lamp.x << ","
                                                << lamp.y << " to " << layout_name(to.kind);
    }
  }
}

TEST(LampsOfOneTexel, KeepTheirLightWhenShrunk) {
  for (const Lamp& lamp : kLamps) {
    const MapLayout from = make_layout(lamp.kind, 4 * lamp.size);
    Image source(from.width, from.height, 3);
    source.at(4 * lamp.x, 4 * lamp.y)[1] = 1000;
    const double before = integral(from, source);
    const MapLayout to = make_layout(LayoutKind::equal_area_octahedral, 20);
    // A share of 1e-3 of a texel's weights is a tenth of a lamp that is a hundredth of the texel.
    const double after = integral(to, convert(from, source, to, 1e-5));
    EXPECT_NEAR(after / before, 1, 0.03)
        << layout_name(lamp.kind) << " " << lamp.x << "," << lamp.y;
  }
}

// Positive control: plain bilinear weights give a lamp in the first row (1/8 + 5/12) / (1/2) =
// 13/12 of its light.
TEST(LampsOfOneTexel, GainATwelfthAtAPoleByPlainWeights) {
  const MapLayout from = make_layout(LayoutKind::latlong, 256);
  Image source(from.width, from.height, 3);
  source.at(40, 0)[1] = 1;
  const RowBlend blend(from);
  double plain = 0, conserving = 0;
  constexpr int kFine = 64;
  for (int j = 0; j < 2 * kFine; ++j) {
    for (int i = 0; i < 256 * 4; ++i) {
      const MapPlace place{(i + 0.5) / 4, (j + 0.5) / kFine};
      const double weight = solid_angle_density(from, place.x, place.y) / (4 * kFine);
      plain += smooth_radiance(from, source, place).y * weight;
      conserving += smooth_radiance(from, source, place, blend).y * weight;
    }
  }
  const double before = texel_solid_angle(from, 40, 0);
  EXPECT_NEAR(plain / before, 13.0 / 12, 1e-3);
  EXPECT_NEAR(conserving / before, 1, 1e-3);
}

TEST(EstimateConversion, CountsMoreWhereMoreIsAsked) {
  const MapLayout from = make_layout(LayoutKind::mirror_ball, 128);
  const MapLayout to = make_layout(LayoutKind::latlong, 256);
  const Image source = noise(from);
  const ConversionSource summary(from, source);
  const auto count = [&](double error) {
    return estimate_conversion(summary, to, Rotation{}, MapFilter::adaptive, error);
  };
  const ConversionWork loose = count(0.03), tight = count(1e-3);
  EXPECT_NEAR(loose.texels, 256 * 128, 1);
  EXPECT_GT(tight.places + tight.points, 2 * (loose.places + loose.points));
  // Even light is worth no trouble.
  Image even(from.width, from.height, 3);
  std::fill(even.pixels.begin(), even.pixels.end(), 0.5f);
  const ConversionSource calm(from, even);
  EXPECT_LT(estimate_conversion(calm, to, Rotation{}, MapFilter::adaptive, 1e-3).places,
            tight.places);
}

}  // namespace
}  // namespace lightkiln

#include "core/environment/brute_force.h"

#include <cstring>

#include "core/base/instruction_sets.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/quadrature.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace brute_force {

Row read_row(const Environment& environment, int y) {
  constexpr double kBright = 20;
  const Image& map = environment.radiance;
  const size_t width = static_cast<size_t>(map.width);
  const double bright_above = kBright * luminance(environment.mean);
  Row row;
  row.colatitude_rad = (y + 0.5) * kPi / map.height;
  row.omega = latlong_texel_solid_angle(y, map.width, map.height);
  row.red.resize(width);
  row.green.resize(width);
  row.blue.resize(width);
  row.bright.resize(width);
  for (size_t x = 0; x < width; ++x) {
    const Vec3d value = to_double(map.rgb(static_cast<int>(x), y));
    row.red[x] = value.x;
    row.green[x] = value.y;
    row.blue[x] = value.z;
    row.bright[x] = luminance(value) > bright_above;
  }
  return row;
}

Columns::Columns(int width) : sine(static_cast<size_t>(width)), cosine(sine.size()) {
  for (size_t x = 0; x < sine.size(); ++x) {
    const double phi = kPi - (static_cast<double>(x) + 0.5) * (2 * kPi / width);
    sine[x] = std::sin(phi);
    cosine[x] = std::cos(phi);
  }
}

LIGHTKILN_CLONES void fill_cosines(const Columns& columns, const Vec3d& axis, double colatitude_rad,
                                   std::span<double> cosines) {
  const double along = axis.y * std::cos(colatitude_rad), ring = std::sin(colatitude_rad);
  const double *sine = columns.sine.data(), *cosine = columns.cosine.data();
  double* out = cosines.data();
  const size_t count = cosines.size();
  for (size_t x = 0; x < count; ++x) {
    const double c = along + ring * (axis.x * sine[x] + axis.z * cosine[x]);
    const double most = c < 1 ? c : 1;
    out[x] = most > -1 ? most : -1;
  }
}

namespace {

// 1 where the texel is an exception.
LIGHTKILN_CLONES void mark(const double* cosines, const uint8_t* bright, double side, double near,
                           uint8_t* marks, size_t count) {
  for (size_t x = 0; x < count; ++x) {
    const double c = cosines[x];
    marks[x] = static_cast<uint8_t>((std::abs(c) < side) | (c > near) | bright[x]);
  }
}

}  // namespace

void find_exceptions(const Row& row, std::span<const double> cosines, double side, double near,
                     std::vector<size_t>* columns) {
  constexpr size_t kAtOnce = 64;
  columns->clear();
  for (size_t begin = 0; begin < cosines.size(); begin += kAtOnce) {
    const size_t count = std::min(kAtOnce, cosines.size() - begin);
    uint8_t marks[kAtOnce];
    mark(&cosines[begin], &row.bright[begin], side, near, marks, count);
    for (const uint8_t* at = marks; at < marks + count; ++at) {
      at = static_cast<const uint8_t*>(std::memchr(at, 1, static_cast<size_t>(marks + count - at)));
      if (at == nullptr) break;
      columns->push_back(begin + static_cast<size_t>(at - marks));
    }
  }
}

// Eight partial sums of each colour, whatever the machine's vectors hold.
LIGHTKILN_CLONES Vec3d weighted_sum(const Row& row, std::span<const double> weights) {
  constexpr size_t kLanes = 8;
  double sums[3][kLanes] = {};
  const double* colors[3] = {row.red.data(), row.green.data(), row.blue.data()};
  const size_t count = weights.size(), whole = count - count % kLanes;
  for (int c = 0; c < 3; ++c) {
    for (size_t x = 0; x < whole; x += kLanes) {
      for (size_t k = 0; k < kLanes; ++k) sums[c][k] += weights[x + k] * colors[c][x + k];
    }
    for (size_t x = whole; x < count; ++x) sums[c][0] += weights[x] * colors[c][x];
  }
  Vec3d total;
  for (size_t k = 0; k < kLanes; ++k) total += Vec3d{sums[0][k], sums[1][k], sums[2][k]};
  return total;
}

}  // namespace brute_force

// A texel is a box: along its row cos(m phi) integrates to (2/m) sin(m s/2) cos(m phi_centre), and
// across it Gauss points of P_lm sin(theta), eight a row, are exact to the last digit as long as a
// row spans less than a radian of the band. The standard library's Y_lm(theta, 0) carries the
// Condon-Shortley phase, which is taken off.
Vec3d projected_coefficient(const Environment& environment, int l, int m) {
  constexpr int kPoints = 8;
  static const GaussRule rule = gauss_legendre(kPoints);
  const Image& map = environment.radiance;
  const int order = std::abs(m);
  const double step = 2 * kPi / map.width, row_step = kPi / map.height;
  const double box = order > 0 ? 2 * std::sin(order * step / 2) / order : step;
  const double scale = (order % 2 == 1 ? -1.0 : 1.0) * (order > 0 ? std::sqrt(2.0) : 1.0) * box;
  std::vector<double> wave(static_cast<size_t>(map.width));
  for (size_t x = 0; x < wave.size(); ++x) {
    const double phi = kPi - (static_cast<double>(x) + 0.5) * step;
    wave[x] = m < 0 ? std::sin(order * phi) : std::cos(order * phi);
  }
  Vec3d sum;
  for (int y = 0; y < map.height; ++y) {
    double height = 0;
    for (size_t k = 0; k < kPoints; ++k) {
      const double theta = (y + 0.5 + 0.5 * rule.nodes[k]) * row_step;
      height += 0.5 * row_step * rule.weights[k] * std::sin(theta) *
                std::sph_legendre(static_cast<unsigned>(l), static_cast<unsigned>(order), theta);
    }
    Vec3d row;
    for (size_t x = 0; x < wave.size(); ++x) {
      row += to_double(map.rgb(static_cast<int>(x), y)) * wave[x];
    }
    sum += row * (height * scale);
  }
  return sum;
}

Vec3d texel_average(const Environment& environment, int face, int x, int y, int size) {
  constexpr int kCuts = 200;
  const Image& map = environment.radiance;
  Vec3d sum;
  double all = 0;
  for (int j = 0; j < kCuts; ++j) {
    for (int i = 0; i < kCuts; ++i) {
      const double s = (x + (i + 0.5) / kCuts) / size, t = (y + (j + 0.5) / kCuts) / size;
      const double a = 2 * s - 1, b = 2 * t - 1;
      const double weight = 1 / ((1 + a * a + b * b) * std::sqrt(1 + a * a + b * b));
      double u = 0, v = 0;
      latlong_coordinates(cube_direction(face, s, t), &u, &v);
      const int column = std::min(static_cast<int>(u * map.width), map.width - 1);
      const int row = std::min(static_cast<int>(v * map.height), map.height - 1);
      sum += to_double(map.rgb(column, row)) * weight;
      all += weight;
    }
  }
  return sum / all;
}

}  // namespace lightkiln

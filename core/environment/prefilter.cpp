// Sources: Ramamoorthi & Hanrahan, "A Signal-Processing Framework for Inverse Rendering", SIGGRAPH
// 2001 (reflection as convolution); Driscoll & Healy 1994 (zonal convolution multiplies bands).

#include "core/environment/prefilter.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/base/parallel.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

// Texels this many times brighter than the mean are candidates for correction.
constexpr double kBrightFactor = 20;
// Rings and longitudes of the grid that a level is read from, per band.
constexpr double kRingsPerBand = 2.5;
constexpr double kLongitudesPerBand = 5;

struct Moments {
  Vec3d squares;  // integral of radiance squared
  Vec3d energy;   // integral of radiance
  double spread(double mean_luminance) const {
    double largest = 0;
    for (int c = 0; c < 3; ++c) {
      const double mean = energy[c] / (4 * kPi);
      largest = std::max(largest, squares[c] / (4 * kPi) - mean * mean);
    }
    return std::sqrt(std::max(largest, 0.0)) / mean_luminance;
  }
};

struct Candidate {
  int x, y;
  double power;  // luminance squared times solid angle: its share of the squared norm
};

// Responses that matter lie below about 12 / alpha, from where only the horizon's kink is left,
// which falls as l^-2.5.
int response_count(double alpha) {
  return std::clamp(static_cast<int>(20 / alpha), 512, kMaxBands);
}

// max_{l >= L} |h_l| for every L.
std::vector<double> response_tails(const std::vector<double>& responses) {
  std::vector<double> tails = responses;
  // Beyond the kink's reach odd bands vanish: the last one says nothing of what follows it.
  double largest = std::abs(responses[responses.size() - 2]);
  for (size_t l = tails.size(); l-- > 0;) {
    largest = std::max(largest, std::abs(responses[l]));
    tails[l] = largest;
  }
  return tails;
}

int first_under(const std::vector<double>& tails, double limit) {
  for (size_t l = 1; l < tails.size(); ++l) {
    if (tails[l] <= limit) return static_cast<int>(l);
  }
  return -1;
}

struct BandChoice {
  int bands = 0;
  bool corrected = false;
};

// Cutting at L removes bands of the map whose squared norm is at most the map's variance, each
// times |h_l|: rms error <= max_{l>=L} |h_l| spread (Parseval). With the bright texels corrected in
// closed form, only the rest of the map is cut. A part of the target is granted to this cut; a
// smaller one without correction, since the error then gathers where the sun stands.
BandChoice choose_bands(const LightStatistics& light, const std::vector<double>& tails,
                        double target) {
  const int all = first_under(tails, 0.1 * target / light.spread);
  const int rest = first_under(tails, 0.5 * target / light.rest_spread);
  // Correction costs a term per texel and bright texel; a few more bands are cheaper.
  if (all > 0 && (light.bright.empty() || all <= rest + rest / 2 + 48)) {
    return {all, false};
  }
  if (rest > 0) return {rest, !light.bright.empty()};
  return {static_cast<int>(tails.size()) - 1, !light.bright.empty()};
}

// The angle between unit vectors with cosine c, to 2e-8: Abramowitz & Stegun 4.4.46,
// acos(x) = sqrt(1 - x) poly(x), mirrored for negative x.
double fast_acos(double c) {
  const double x = std::min(std::abs(c), 1.0);
  double p = -0.0012624911;
  for (const double k : {0.0066700901, -0.0170881256, 0.0308918810, -0.0501743046, 0.0889789874,
                         -0.2145988016, 1.5707963050}) {
    p = p * x + k;
  }
  const double angle = std::sqrt(1 - x) * p;
  return c < 0 ? kPi - angle : angle;
}

constexpr int kTableStepsPerBand = 32;

// What the band limit cuts off the lobe: K(t) - sum_{l<L} (2l+1)/(4 pi) h_l P_l(cos t), at equal
// steps of the angle from 0 to pi. An even number of steps puts the kink at pi/2 on a point.
std::vector<double> cut_table(const GgxLobe& lobe, const std::vector<double>& responses) {
  const int steps = kTableStepsPerBand * static_cast<int>(responses.size());
  std::vector<double> table(static_cast<size_t>(steps) + 2);
  for (int i = 0; i <= steps; ++i) {
    const double angle = kPi * i / steps, z = std::cos(angle);
    double before = 0, value = 1, sum = 0;
    for (size_t l = 0; l < responses.size(); ++l) {
      const double degree = static_cast<double>(l);
      if (l > 0) {
        const double next = ((2 * degree - 1) * z * value - (degree - 1) * before) / degree;
        before = value;
        value = next;
      }
      sum += (2 * degree + 1) / (4 * kPi) * responses[l] * value;
    }
    table[static_cast<size_t>(i)] = lobe.at_angle(angle) - sum;
  }
  table.back() = table[static_cast<size_t>(steps)];
  return table;
}

struct PointSource {
  Vec3d direction, energy;
};

// A texel acts as a point on bands l while l times its extent is small; larger ones are cut into
// this many a side, as long as the points stay few.
constexpr double kMaxPoints = 384;
constexpr double kPointPhase = 0.2;
int point_cuts(const LightStatistics& light, int bands) {
  const double most = std::sqrt(kMaxPoints / static_cast<double>(light.bright.size()));
  const double wanted = std::ceil(light.bright.front().extent_rad * bands / kPointPhase);
  return static_cast<int>(std::clamp(wanted, 1.0, std::max(1.0, std::floor(most))));
}
std::vector<PointSource> bright_points(const LightStatistics& light, int bands) {
  std::vector<PointSource> points;
  const int cuts = point_cuts(light, bands);
  for (const BrightTexel& texel : light.bright) {
    double u = 0, v = 0;
    latlong_coordinates(texel.direction, &u, &v);
    const double dv = texel.extent_rad / kPi, du = dv / 2;  // texels of a 2:1 map are square
    for (int j = 0; j < cuts; ++j) {
      for (int i = 0; i < cuts; ++i) {
        const Vec3d direction =
            latlong_direction(u + du * ((i + 0.5) / cuts - 0.5), v + dv * ((j + 0.5) / cuts - 0.5));
        points.push_back({direction, texel.energy / (cuts * cuts)});
      }
    }
  }
  return points;
}

Vec3d cut_light(const std::vector<double>& table, const std::vector<PointSource>& points,
                const Vec3d& direction) {
  const double scale = static_cast<double>(table.size() - 2) / kPi;
  Vec3d sum;
  for (const PointSource& point : points) {
    const double place = fast_acos(dot(point.direction, direction)) * scale;
    const size_t index = static_cast<size_t>(place);
    const double f = place - static_cast<double>(index);
    sum += point.energy * (table[index] * (1 - f) + table[index + 1] * f);
  }
  return sum;
}

int rings_for(int bands) {
  return std::max(16, 2 * static_cast<int>(std::ceil(kRingsPerBand * bands / 2)));
}
int longitudes_for(int bands) {
  int result = 16;
  while (result < kLongitudesPerBand * bands) result *= 2;
  return result;
}

// Interpolating the grid: band l errs by at most e_l h_l of its part of the map.
double interpolation_bound(const LightStatistics& light, const std::vector<double>& responses,
                           int bands) {
  const int rings = rings_for(bands), longitudes = longitudes_for(bands);
  double largest = 0;
  for (int l = 1; l < bands; ++l) {
    const double error = RingGrid::interpolation_error(l, rings, longitudes);
    largest = std::max(largest, error * std::abs(responses[static_cast<size_t>(l)]));
  }
  return largest * light.spread;
}

// Bright texels stand as points of extent s: band l of a box differs from a point's by at most
// min(1, (l s)^2 / 24) of it. Taken as if all their energy E were one source, whose squared norm in
// band l is E^2 (2l+1) / (4 pi). Beyond the computed bands only even ones are left, which fall as
// l^-2.5; past sixteen times as many, the sum's rest is an integral.
double point_bound(const LightStatistics& light, const std::vector<double>& responses, int bands) {
  const double extent = light.bright.front().extent_rad / point_cuts(light, bands);
  const auto term = [&](double l, double response) {
    const double miss = std::min(1.0, l * l * extent * extent / 24) * response;
    return (2 * l + 1) * miss * miss;
  };
  double sum = 0;
  for (size_t l = static_cast<size_t>(bands); l < responses.size(); ++l) {
    sum += term(static_cast<double>(l), responses[l]);
  }
  const double count = static_cast<double>(responses.size());
  const double last = std::max(std::abs(responses.back()), std::abs(responses.end()[-2]));
  double l = count;
  for (; l < 16 * count; l += 2) sum += term(l, last * std::pow(l / count, -2.5));
  sum += last * last * std::pow(l / count, -5) * l * l / 3;
  return light.bright_share * std::sqrt(sum);
}

}  // namespace

LightStatistics measure_light(const Environment& environment) {
  const Image& map = environment.radiance;
  LightStatistics light;
  light.mean = environment.mean;
  light.mean_luminance = luminance(environment.mean);
  light.lowest = light.highest = map.rgb(0, 0);
  Moments all;
  std::vector<Candidate> candidates;
  const double threshold = kBrightFactor * light.mean_luminance;
  for (int y = 0; y < map.height; ++y) {
    const double omega = latlong_texel_solid_angle(y, map.width, map.height);
    Vec3d squares, energy;
    for (int x = 0; x < map.width; ++x) {
      const Vec3 value = map.rgb(x, y);
      const Vec3d exact = to_double(value);
      squares += exact * exact;
      energy += exact;
      for (int c = 0; c < 3; ++c) {
        light.lowest[c] = std::min(light.lowest[c], value[c]);
        light.highest[c] = std::max(light.highest[c], value[c]);
      }
      const double bright = luminance(exact);
      if (bright > threshold) candidates.push_back({x, y, bright * bright * omega});
    }
    all.squares += squares * omega;
    all.energy += energy * omega;
  }
  if (environment.constant || !(light.mean_luminance > 0)) return light;
  light.spread = all.spread(light.mean_luminance);

  const size_t count = std::min<size_t>(candidates.size(), kMaxBrightTexels);
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<long>(count),
                    candidates.end(), [](const Candidate& a, const Candidate& b) {
                      return a.power != b.power ? a.power > b.power
                                                : std::pair(a.y, a.x) < std::pair(b.y, b.x);
                    });
  Moments rest = all;
  const double total = luminance(all.energy);
  for (size_t i = 0; i < count; ++i) {
    const Candidate& c = candidates[i];
    // Enough when the rest is as tame as an ordinary sky, or one texel no longer matters.
    const double spread = rest.spread(light.mean_luminance) * light.mean_luminance;
    if (spread < 2 * light.mean_luminance || c.power < 1e-3 * spread * spread * 4 * kPi) break;
    const double omega = latlong_texel_solid_angle(c.y, map.width, map.height);
    const Vec3d value = to_double(map.rgb(c.x, c.y));
    light.bright.push_back({latlong_direction((c.x + 0.5) / map.width, (c.y + 0.5) / map.height),
                            value * omega, kPi / map.height});
    light.bright_share += luminance(value) * omega / total;
    rest.squares -= value * value * omega;
    rest.energy -= value * omega;
  }
  light.rest_spread = light.bright.empty() ? light.spread : rest.spread(light.mean_luminance);
  return light;
}

LobePlan plan_lobe(const LightStatistics& light, double alpha, double target) {
  const GgxLobe lobe(alpha);
  const std::vector<double> responses = ggx_band_responses(lobe, response_count(alpha));
  const std::vector<double> tails = response_tails(responses);
  BandChoice choice = choose_bands(light, tails, target);
  const auto total_bound = [&](bool corrected) {
    const double cut =
        tails[static_cast<size_t>(choice.bands)] * (corrected ? light.rest_spread : light.spread);
    return cut + interpolation_bound(light, responses, choice.bands) +
           (corrected ? point_bound(light, responses, choice.bands) : 0.0);
  };
  const int most = static_cast<int>(responses.size()) - 1;
  while (total_bound(choice.corrected) > target && choice.bands < most) {
    choice.bands = std::min(most, choice.bands + choice.bands / 8 + 1);
  }
  LobePlan plan;
  plan.alpha = alpha;
  plan.bands = choice.bands;
  plan.corrected = choice.corrected;
  plan.responses.assign(responses.begin(), responses.begin() + choice.bands);
  plan.error_bound = total_bound(choice.corrected);
  plan.uncorrected_bound = total_bound(false);
  return plan;
}

LatlongSpectrum project_for(const Environment& environment, std::span<const LobePlan> lobes,
                            int sh_bands, int threads, Progress& progress) {
  std::vector<double> weights(static_cast<size_t>(sh_bands), 1.0);
  for (const LobePlan& lobe : lobes) {
    if (weights.size() < lobe.responses.size()) weights.resize(lobe.responses.size());
    for (size_t l = 0; l < lobe.responses.size(); ++l) {
      weights[l] = std::max(weights[l], std::abs(lobe.responses[l]));
    }
  }
  const int points = row_gauss_points(environment.radiance.height, weights, 1e-8);
  return project_latlong(environment.radiance, static_cast<int>(weights.size()), points, threads,
                         progress);
}

Image convolve_lobe(const LightStatistics& light, const LatlongSpectrum& spectrum,
                    const LobePlan& lobe, int face_size, int threads, Progress& progress,
                    RangeReport* range) {
  const RingGrid grid = synthesise_rings(spectrum, lobe.responses, rings_for(lobe.bands),
                                         longitudes_for(lobe.bands), threads, progress);
  const std::vector<double> table =
      lobe.corrected ? cut_table(GgxLobe(lobe.alpha), lobe.responses) : std::vector<double>{};
  const std::vector<PointSource> points =
      lobe.corrected ? bright_points(light, lobe.bands) : std::vector<PointSource>{};
  Image cube(face_size, 6 * face_size, 3);
  RangeReport report;
  std::mutex mutex;
  parallel_blocks(
      static_cast<size_t>(cube.height), 8, threads, progress, [&](size_t begin, size_t end) {
        RangeReport mine;
        for (size_t row = begin; row < end; ++row) {
          const int line = static_cast<int>(row);
          for (int x = 0; x < face_size; ++x) {
            const Vec3d direction =
                cube_texel_direction(line / face_size, x, line % face_size, face_size);
            Vec3d value = grid.interpolate(direction);
            if (lobe.corrected) value += cut_light(table, points, direction);
            double most = 0;
            for (int c = 0; c < 3; ++c) {
              const double inside =
                  std::clamp(value[c], double(light.lowest[c]), double(light.highest[c]));
              most = std::max(most, std::abs(inside - value[c]) / light.mean_luminance);
              cube.at(x, line)[c] = static_cast<float>(inside);
            }
            mine.texels += most > 0;
            mine.most = std::max(mine.most, most);
          }
        }
        const std::lock_guard lock(mutex);
        report.texels += mine.texels;
        report.most = std::max(report.most, mine.most);
      });
  if (range) *range = report;
  return cube;
}

}  // namespace lightkiln

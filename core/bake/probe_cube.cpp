#include "core/bake/probe_cube.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

constexpr size_t kBlocksPerWave = 32;
constexpr size_t kMostTexelsPerBlock = 64;
constexpr size_t kPathsPerBlock = 1 << 14;

struct Place {
  int face, x, y;
};
Place place_of(uint32_t texel, int size) {
  const auto n = static_cast<uint32_t>(size);
  return {static_cast<int>(texel / (n * n)), static_cast<int>(texel % n),
          static_cast<int>(texel / n % n)};
}

// d(omega)/d(area of the face [-1, 1]^2) in a unit direction: the distance to the face is
// 1 / cosine, so cosine / distance^2 = cosine^3, where the cosine is the largest component.
double face_jacobian(const Vec3d& direction) {
  const double cosine =
      std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
  return cosine * cosine * cosine;
}

// A point of a texel: the direction through it, and d(omega)/d(area of the face [-1, 1]^2) there,
// (1 + a^2 + b^2)^(-3/2) for face coordinates a, b: the squared distance to the plane point and its
// cosine.
struct CubePoint {
  Vec3d direction;
  double jacobian;
};
CubePoint cube_point(const Place& place, int size, double within_x, double within_y) {
  const double s = (place.x + within_x) / size;
  const double t = (place.y + within_y) / size;
  const double a = 2 * s - 1, b = 2 * t - 1;
  const double distance2 = 1 + a * a + b * b;
  return {cube_direction(place.face, s, t), 1 / (distance2 * std::sqrt(distance2))};
}

// The integral of every basis function over a texel, by Gauss-Legendre of 3 x 3 points on enough
// parts, scaled so that the first is exactly the texel's solid angle times y_00.
void integrate_basis(const Place& place, int size, int bands, double solid_angle,
                     std::span<double> integral) {
  static constexpr double kNode = 0.7745966692414834;  // sqrt(3/5)
  static constexpr double kNodes[3] = {-kNode, 0, kNode};
  static constexpr double kWeights[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
  const int parts = std::max(1, 16 / size);
  std::vector<double> basis(integral.size());
  std::fill(integral.begin(), integral.end(), 0.0);
  double whole = 0;
  for (int i = 0; i < 3 * parts; ++i) {
    for (int j = 0; j < 3 * parts; ++j) {
      const auto at = [&](int k) { return (k / 3 + 0.5 + 0.5 * kNodes[k % 3]) / parts; };
      const CubePoint point = cube_point(place, size, at(i), at(j));
      const double weight = kWeights[i % 3] * kWeights[j % 3] * point.jacobian;
      sh_evaluate_basis(point.direction, bands, basis);
      for (size_t c = 0; c < basis.size(); ++c) integral[c] += weight * basis[c];
      whole += weight;
    }
  }
  for (double& value : integral) value *= solid_angle / whole;
}

// Gathers one replicate's share of the harmonics of one texel: see sample_texel.
class TexelHarmonics {
 public:
  TexelHarmonics(const Place& place, int size, int bands)
      : bands_(bands), solid_angle_(cube_texel_solid_angle(place.x, place.y, size)) {
    const size_t count = sh_coefficient_count(bands);
    integral_.resize(count);
    basis_.resize(count);
    basis_sum_.resize(count);
    radiance_sum_.resize(count);
    if (bands > 0) integrate_basis(place, size, bands, solid_angle_, integral_);
  }
  void begin() {
    std::fill(basis_sum_.begin(), basis_sum_.end(), 0.0);
    std::fill(radiance_sum_.begin(), radiance_sum_.end(), Vec3d{});
    jacobians_ = 0;
    radiance_ = {};
  }
  void add(const CubePoint& point, const Vec3d& radiance) {
    if (bands_ == 0) return;
    sh_evaluate_basis(point.direction, bands_, basis_);
    const Vec3d weighted = radiance * point.jacobian;
    jacobians_ += point.jacobian;
    radiance_ += weighted;
    for (size_t c = 0; c < basis_.size(); ++c) {
      basis_sum_[c] += point.jacobian * basis_[c];
      radiance_sum_[c] += weighted * basis_[c];
    }
  }
  // Adds the replicate's coefficients.
  void end(std::span<Vec3d> coefficients) const {
    if (bands_ == 0) return;
    const double scale = solid_angle_ / jacobians_;
    const Vec3d mean = radiance_ / jacobians_;
    for (size_t c = 0; c < basis_.size(); ++c) {
      coefficients[c] += radiance_sum_[c] * scale + mean * (integral_[c] - basis_sum_[c] * scale);
    }
  }

 private:
  int bands_;
  double solid_angle_;
  double jacobians_ = 0;
  Vec3d radiance_;
  std::vector<double> integral_, basis_, basis_sum_;
  std::vector<Vec3d> radiance_sum_;
};

double half_width_factor() {
  static const double factor = student_t(0.95, kReplicates - 1) / std::sqrt(double{kReplicates});
  return factor;
}

}  // namespace

CubeTexels all_texels(int size) {
  CubeTexels all;
  all.size = size;
  const auto count = static_cast<uint32_t>(6 * size * size);
  for (uint32_t i = 0; i < count; ++i) {
    const Place place = place_of(i, size);
    all.texels.push_back(i);
    all.shares.push_back(cube_texel_solid_angle(place.x, place.y, size) / (4 * kPi));
  }
  return all;
}

CubeTexels sparse_texels(int size, int cells, uint64_t seed) {
  cells = std::min(cells, size);
  CubeTexels some;
  some.size = size;
  for (int face = 0; face < 6; ++face) {
    for (int row = 0; row < cells; ++row) {
      for (int column = 0; column < cells; ++column) {
        const int x0 = size * column / cells, x1 = size * (column + 1) / cells;
        const int y0 = size * row / cells, y1 = size * (row + 1) / cells;
        const auto cell = static_cast<uint64_t>((face * cells + row) * cells + column);
        const uint64_t drawn = hash_combine(seed, cell);
        const int x = x0 + static_cast<int>(drawn % static_cast<uint64_t>(x1 - x0));
        const int y = y0 + static_cast<int>((drawn >> 32) % static_cast<uint64_t>(y1 - y0));
        some.texels.push_back(static_cast<uint32_t>((face * size + y) * size + x));
        some.shares.push_back(cube_texel_solid_angle(column, row, cells) / (4 * kPi));
      }
    }
  }
  return some;
}

CubeSampling::CubeSampling(const RadianceScene& scene, const CubeTexels& texels, const Vec3& origin,
                           uint64_t key, int bands, int threads)
    : scene_(scene),
      order_(texels),
      origin_(origin),
      key_(key),
      bands_(bands),
      threads_(threads),
      slots_(texels.texels.size()),
      harmonics_(kReplicates * sh_coefficient_count(bands)) {
  const auto all = static_cast<size_t>(6 * texels.size * texels.size);
  if (texels.texels.size() == all) return;
  slot_by_texel_.assign(all, kNowhere);
  for (size_t i = 0; i < texels.texels.size(); ++i) {
    slot_by_texel_[texels.texels[i]] = static_cast<uint32_t>(i);
  }
}

// Points are uniform in the texel's area A = (2 / N)^2 of the face, so a texel's samples have
// density 1 / (A J) per steradian each; against kDirectPerSample searches that is its share.
float CubeSampling::first_density(const Vec3d& direction) const {
  const double area = 4.0 / (order_.size * order_.size);
  return static_cast<float>(1 / (kDirectPerSample * area * face_jacobian(direction)));
}

uint32_t CubeSampling::slot_of(const Vec3d& direction) const {
  int face = 0;
  double s = 0, t = 0;
  cube_coordinates(direction, &face, &s, &t);
  const int n = order_.size;
  const int x = std::min(static_cast<int>(s * n), n - 1);
  const int y = std::min(static_cast<int>(t * n), n - 1);
  const auto texel = static_cast<uint32_t>((face * n + y) * n + x);
  return slot_by_texel_.empty() ? texel : slot_by_texel_[texel];
}

CubeSampling::Sighting CubeSampling::look(bool lamp, uint64_t replicate, uint32_t index,
                                          RayCounters& counters) const {
  const auto set =
      static_cast<uint64_t>(lamp ? DimensionSet::probe_lamp : DimensionSet::probe_glare);
  const uint64_t key = hash_combine(hash_combine(key_, replicate), set);
  const auto density = [this](const Vec3& direction) {
    return first_density(to_double(direction));
  };
  const DirectLight light = lamp ? scene_.lamp(origin_, sobol4(key, index), density, counters)
                                 : scene_.glare(origin_, sobol2(key, index), density, counters);
  if (!(light.radiance.x + light.radiance.y + light.radiance.z > 0)) return {};
  return {slot_of(to_double(light.direction)), light};
}

// Searches in parallel, adds in order. A light of weight w found within a texel counts like one of
// its n points: L w to its sum, and L w A J y / n to the harmonics, its share of the integral.
void CubeSampling::look_directly(bool lamp, uint32_t from, uint32_t to, Progress& progress,
                                 double done, RayCounters* counters,
                                 std::vector<Vec3d>* harmonics) {
  constexpr size_t kWave = 1 << 16, kBlock = 1 << 12;
  const size_t each = size_t{kDirectPerSample} * (to - from), all = kReplicates * each;
  const double area = 4.0 / (order_.size * order_.size);
  const size_t coefficients = sh_coefficient_count(bands_);
  std::vector<double> basis(coefficients);
  std::vector<Sighting> found(std::min(all, kWave));
  for (size_t first = 0; first < all; first += kWave) {
    const size_t count = std::min(kWave, all - first);
    std::vector<RayCounters> counted((count + kBlock - 1) / kBlock);
    parallel_blocks(
        count, kBlock, threads_, progress,
        [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i) {
            const size_t number = first + i;
            const auto index = static_cast<uint32_t>(kDirectPerSample * from + number % each);
            found[i] = look(lamp, number / each, index, counted[begin / kBlock]);
          }
        },
        done, done);
    for (const RayCounters& some : counted) *counters += some;
    for (size_t i = 0; i < count; ++i) {
      if (found[i].slot == kNowhere) continue;
      const size_t replicate = (first + i) / each;
      const Vec3d radiance = to_double(found[i].light.radiance);
      Texel& slot = slots_[found[i].slot];
      slot.sum += radiance;
      slot.luminance[replicate] += luminance(radiance);
      slot.tail.add(luminance(radiance));
      if (bands_ == 0) continue;
      const Vec3d direction = to_double(found[i].light.direction);
      sh_evaluate_basis(direction, bands_, basis);
      const Vec3d share = radiance * (area * face_jacobian(direction) / (to - from));
      for (size_t c = 0; c < coefficients; ++c) {
        (*harmonics)[replicate * coefficients + c] += share * basis[c];
      }
    }
  }
}

// One texel's samples [from, to) of every replicate.
//
// With weights w_i = J_i dOmega / sum J, which sum to the texel's solid angle whatever points were
// drawn, and the mean L' = sum w_i L_i / dOmega, the harmonics take
//   sum w_i y(d_i) (L_i - L') + L' integral of y = sum w_i y_i L_i + L' (integral y - sum w_i y_i),
// so that light that does not vary within the texel is integrated without noise.
void CubeSampling::sample_texel(size_t i, uint32_t from, uint32_t to, Progress& progress,
                                Block* block) {
  const Place place = place_of(order_.texels[i], order_.size);
  const uint64_t texel_key = hash_combine(key_, order_.texels[i]);
  Texel& slot = slots_[i];
  TexelHarmonics harmonics(place, order_.size, bands_);
  const bool looks = scene_.has_glare() || scene_.has_lamps();
  for (uint64_t r = 0; r < kReplicates; ++r) {
    progress.check();
    const uint64_t key = hash_combine(texel_key, r);
    const uint64_t pixel_key = hash_combine(key, static_cast<uint64_t>(DimensionSet::probe_pixel));
    harmonics.begin();
    Vec3d sum;
    for (uint32_t k = from; k < to; ++k) {
      const Point2 within = sobol2(pixel_key, k);
      const CubePoint point = cube_point(place, order_.size, static_cast<double>(within.x),
                                         static_cast<double>(within.y));
      const Vec3d radiance =
          to_double(scene_.sample({origin_, to_float(point.direction)}, key, k, block->counters,
                                  looks ? first_density(point.direction) : 0));
      sum += radiance;
      slot.tail.add(luminance(radiance));
      harmonics.add(point, radiance);
    }
    slot.sum += sum;
    slot.luminance[r] += luminance(sum);
    harmonics.end(std::span(block->harmonics).subspan(r * sh_coefficient_count(bands_)));
  }
}

Round CubeSampling::advance(Progress& progress, double progress_begin, double progress_end) {
  const double wall = wall_seconds(), cpu = process_cpu_seconds();
  const uint32_t from = taken_, to = taken_ == 0 ? kFirstSamples : 2 * taken_;
  const size_t texels = slots_.size();
  const size_t paths_each = kReplicates * static_cast<size_t>(to - from);
  const size_t block_texels =
      std::clamp<size_t>(kPathsPerBlock / paths_each, 1, kMostTexelsPerBlock);
  const size_t wave_texels = kBlocksPerWave * block_texels;

  RayCounters counters;
  std::vector<Vec3d> fresh(harmonics_.size());
  for (size_t first = 0; first < texels; first += wave_texels) {
    const size_t count = std::min(wave_texels, texels - first);
    std::vector<Block> blocks((count + block_texels - 1) / block_texels);
    const auto share = [&](size_t done) {
      return progress_begin + (progress_end - progress_begin) * static_cast<double>(done) /
                                  static_cast<double>(texels);
    };
    parallel_blocks(
        count, block_texels, threads_, progress,
        [&](size_t begin, size_t end) {
          Block& block = blocks[begin / block_texels];
          block.harmonics.resize(harmonics_.size());
          for (size_t i = begin; i < end; ++i) sample_texel(first + i, from, to, progress, &block);
        },
        share(first), share(first + count));
    for (const Block& block : blocks) {
      counters += block.counters;
      for (size_t c = 0; c < fresh.size(); ++c) fresh[c] += block.harmonics[c];
    }
  }
  for (const bool lamp : {false, true}) {
    if (!(lamp ? scene_.has_lamps() : scene_.has_glare())) continue;
    look_directly(lamp, from, to, progress, progress_end, &counters, &fresh);
  }
  const double old_share = static_cast<double>(from) / to;
  for (size_t c = 0; c < fresh.size(); ++c) {
    harmonics_[c] = harmonics_[c] * old_share + fresh[c] * (1 - old_share);
  }
  taken_ = to;
  counters_ += counters;

  Round round;
  round.samples = samples();
  round.rays = counters.nearest_rays + counters.bounce_rays + counters.shadow_rays;
  round.elements = 1;
  round.cpu_s = process_cpu_seconds() - cpu;
  round.wall_s = wall_seconds() - wall;
  return round;
}

uint64_t CubeSampling::samples() const {
  return static_cast<uint64_t>(kReplicates) * taken_;
}

Vec3 CubeSampling::texel(size_t i) const {
  return to_float(slots_[i].sum / static_cast<double>(samples()));
}

double CubeSampling::mean_luminance() const {
  double sum = 0;
  for (size_t i = 0; i < slots_.size(); ++i) sum += order_.shares[i] * luminance(slots_[i].sum);
  return sum / static_cast<double>(samples());
}

double CubeSampling::half_width(size_t i) const {
  RunningMoments moments;
  for (const double sum : slots_[i].luminance) moments.add(sum / static_cast<double>(taken_));
  return half_width_factor() * std::sqrt(moments.variance());
}

double CubeSampling::error() const {
  double sum = 0;
  for (size_t i = 0; i < slots_.size(); ++i) {
    const double half = half_width(i);
    sum += order_.shares[i] * half * half;
  }
  return std::sqrt(sum);
}

bool CubeSampling::suspicious() const {
  double whole = 0, doubtful = 0;
  for (size_t i = 0; i < slots_.size(); ++i) {
    const double half = half_width(i), part = order_.shares[i] * half * half;
    whole += part;
    if (slots_[i].tail.suspicious()) doubtful += part;
  }
  return doubtful > 0.5 * whole;
}

ShRgb CubeSampling::harmonics() const {
  ShRgb sh(bands_);
  for (size_t i = 0; i < harmonics_.size(); ++i) {
    sh.coefficients[i % sh.coefficients.size()] += harmonics_[i] * (1.0 / kReplicates);
  }
  return sh;
}

double CubeSampling::harmonics_error() const {
  const size_t coefficients = sh_coefficient_count(bands_);
  double largest = 0, first = 0;
  for (size_t c = 0; c < coefficients; ++c) {
    RunningMoments moments;
    for (size_t r = 0; r < kReplicates; ++r) {
      moments.add(luminance(harmonics_[r * coefficients + c]));
    }
    if (c == 0) first = std::abs(moments.mean);
    largest = std::max(largest, half_width_factor() * std::sqrt(moments.variance()));
  }
  return first > 0 ? largest / first : 0;
}

}  // namespace lightkiln

#include "core/bake/probe_cube.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "core/bake/texel_harmonics.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

constexpr size_t kBlocksPerWave = 32;
constexpr size_t kMostTexelsPerBlock = 64;
constexpr size_t kPathsPerBlock = 1 << 14;

double half_width_factor() {
  static const double factor = student_t(0.95, kReplicates - 1) / std::sqrt(double{kReplicates});
  return factor;
}

}  // namespace

uint32_t looks_for_one(int size) {
  constexpr uint32_t kPathsPerLook = 16, kMost = 32;
  const auto texels = static_cast<uint32_t>(6 * size * size);
  return std::clamp(std::bit_floor(texels / (kPathsPerLook * kDirectPerSample)), 1u, kMost);
}

CubeTexels all_texels(int size) {
  CubeTexels all;
  all.size = size;
  const auto count = static_cast<uint32_t>(6 * size * size);
  for (uint32_t i = 0; i < count; ++i) {
    const CubePlace place = cube_place(i, size);
    all.texels.push_back(i);
    all.shares.push_back(cube_texel_solid_angle(place.x, place.y, size) / (4 * kPi));
  }
  return all;
}

CubeSampling::CubeSampling(const RadianceScene& scene, const CubeTexels& texels, const Vec3& origin,
                           uint64_t key, int bands, int threads, int replicates)
    : scene_(scene),
      order_(texels),
      origin_(origin),
      key_(key),
      bands_(bands),
      threads_(threads),
      replicates_(static_cast<uint64_t>(replicates)),
      slots_(texels.texels.size()),
      harmonics_(replicates_ * sh_coefficient_count(bands)) {
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

CubeSampling::Sighting CubeSampling::look(Sight sight, uint64_t replicate, uint32_t index,
                                          RayCounters& counters) const {
  const auto set = static_cast<uint64_t>(dimensions_of(sight));
  const uint64_t key = hash_combine(hash_combine(key_, replicate), set);
  const auto density = [this](const Vec3& direction) {
    return first_density(to_double(direction));
  };
  const DirectLight light = scene_.look(sight, origin_, sobol4(key, index), density, counters);
  if (!(light.radiance.x + light.radiance.y + light.radiance.z > 0)) return {};
  return {slot_of(to_double(light.direction)), light};
}

// Searches in parallel, adds in order. A light of weight w found within a texel by one of m looks
// that stand for one counts like one of its n points, over m: L w / m to its sum, and
// L w / m A J y / n to the harmonics, its share of the integral.
void CubeSampling::look_directly(Sight sight, uint32_t from, uint32_t to, Progress& progress,
                                 double done, RayCounters* counters,
                                 std::vector<Vec3d>* harmonics) {
  constexpr size_t kWave = 1 << 16, kBlock = 1 << 12;
  const uint32_t looks = looks_for_one(order_.size), per_sample = kDirectPerSample * looks;
  const size_t each = size_t{per_sample} * (to - from), all = replicates_ * each;
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
            const auto index = static_cast<uint32_t>(per_sample * from + number % each);
            found[i] = look(sight, number / each, index, counted[begin / kBlock]);
          }
        },
        done, done);
    for (const RayCounters& some : counted) *counters += some;
    for (size_t i = 0; i < count; ++i) {
      if (found[i].slot == kNowhere) continue;
      const size_t replicate = (first + i) / each;
      const Vec3d radiance = to_double(found[i].light.radiance) / static_cast<double>(looks);
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
void CubeSampling::sample_texel(size_t i, uint32_t from, uint32_t to, Progress& progress,
                                Block* block) {
  const CubePlace place = cube_place(order_.texels[i], order_.size);
  const uint64_t texel_key = hash_combine(key_, order_.texels[i]);
  Texel& slot = slots_[i];
  TexelHarmonics harmonics(place, order_.size, bands_);
  const bool looks = std::any_of(std::begin(kSights), std::end(kSights),
                                 [this](Sight sight) { return scene_.has(sight); });
  for (uint64_t r = 0; r < replicates_; ++r) {
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
  const size_t paths_each = replicates_ * (to - from);
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
  for (const Sight sight : kSights) {
    if (!scene_.has(sight)) continue;
    look_directly(sight, from, to, progress, progress_end, &counters, &fresh);
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
  return replicates_ * taken_;
}

Vec3 CubeSampling::texel(size_t i) const {
  return to_float(slots_[i].sum / static_cast<double>(samples()));
}

double CubeSampling::mean_luminance() const {
  double sum = 0;
  for (size_t i = 0; i < slots_.size(); ++i) sum += order_.shares[i] * luminance(slots_[i].sum);
  return sum / static_cast<double>(samples());
}

double CubeSampling::variance(size_t i) const {
  RunningMoments moments;
  for (uint64_t r = 0; r < replicates_; ++r) {
    moments.add(slots_[i].luminance[r] / static_cast<double>(taken_));
  }
  return moments.variance();
}

double CubeSampling::half_width(size_t i) const {
  return half_width_factor() * std::sqrt(variance(i));
}

CubeError CubeSampling::error() const {
  CubeErrorSum sum;
  for (size_t i = 0; i < slots_.size(); ++i) {
    double means[kReplicates];
    for (int r = 0; r < kReplicates; ++r) means[r] = slots_[i].luminance[r] / taken_;
    sum.add(means, order_.shares[i]);
  }
  return sum.result();
}

bool CubeSampling::suspicious() const {
  double whole = 0, doubtful = 0;
  for (size_t i = 0; i < slots_.size(); ++i) {
    const double part = order_.shares[i] * variance(i);
    whole += part;
    if (slots_[i].tail.suspicious()) doubtful += part;
  }
  return doubtful > 0.5 * whole;
}

ShRgb CubeSampling::harmonics() const {
  ShRgb sh(bands_);
  for (size_t i = 0; i < harmonics_.size(); ++i) {
    const double part = 1 / static_cast<double>(replicates_);
    sh.coefficients[i % sh.coefficients.size()] += harmonics_[i] * part;
  }
  return sh;
}

double CubeSampling::harmonics_error() const {
  const size_t coefficients = sh_coefficient_count(bands_);
  double largest = 0, first = 0;
  for (size_t c = 0; c < coefficients; ++c) {
    RunningMoments moments;
    for (size_t r = 0; r < replicates_; ++r) {
      moments.add(luminance(harmonics_[r * coefficients + c]));
    }
    if (c == 0) first = std::abs(moments.mean);
    largest = std::max(largest, half_width_factor() * std::sqrt(moments.variance()));
  }
  return first > 0 ? largest / first : 0;
}

}  // namespace lightkiln

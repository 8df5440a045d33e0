#include "core/bake/openness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/bake/hemisphere_points.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/statistics.h"

namespace lightkiln {

namespace {

static_assert(static_cast<size_t>(kReplicates) == kPacketLanes,
              "a packet carries one point of every replicate");

// e^-x for x >= 0 by e^-x = 2^-k 2^f with k integer and f in (-1, 0], the fraction by the Taylor
// series of e^(f ln 2) to the thirteenth power (remainder at most (ln 2)^14 / 14! = 7e-14). Written
// out so that every machine gives the same bits, which the C library's versions do not promise.
double exp_minus(double x) {
  if (x > 700) return 0;
  const double scaled = -x / std::numbers::ln2;
  const double whole = std::ceil(scaled);
  const double f = (scaled - whole) * std::numbers::ln2;
  double series = 1;
  for (int i = 13; i >= 1; --i) series = 1 + f / i * series;
  return std::ldexp(series, static_cast<int>(whole));
}

// Beyond this multiple of falloff_distance the exponential falloff differs from 1 by less than
// 2^-24, the step of a result stored as float.
constexpr double kExponentialReach = 16.635532333438686;  // ln 2^24

// What the packet loop needs of one element.
struct Look {
  std::span<const Facet> facets;
  std::vector<Basis<float>> bases;
  std::vector<uint32_t> thresholds;  // facet i is chosen by z below thresholds[i]
  ReplicateMasks masks;
};

struct Sums {
  std::array<double, kReplicates> openness{};  // summed over each replicate's points
  uint64_t points = 0;                         // of each replicate so far
  int level = 0;                               // blocks of points used so far
  bool rejected = false;                       // the gate refused one of its rays
};

}  // namespace

double falloff_weight(const OpennessParameters& p, double distance) {
  const double t = distance / p.max_distance;
  switch (p.falloff) {
    case Falloff::none:
      return 0;
    case Falloff::linear:
      return t;
    case Falloff::quadratic:
      return t * t;
    case Falloff::smooth:
      return t * t * (3 - 2 * t);
    case Falloff::exponential:
      return 1 - exp_minus(distance / p.falloff_distance);
  }
  return 0;
}

struct OpennessKernel::Impl {
  const Tracer* tracer;
  OpennessParameters parameters;
  float t_far;
  HemispherePoints points;
  double quantile_95;

  Impl(const Tracer& tracer_, const OpennessParameters& p);

  bool surely_open(std::span<const Facet> facets, RayCounters& counters) const;
  Look look_from(const OpennessElement& element) const;
  // Calls each(packet) for the rays of one block of points, cell by cell.
  template <typename Each>
  void each_packet(const Look& look, int level, const Each& each) const;
  void run_level(const Look& look, Sums& sums, RayCounters& counters) const;
  void trace(const RayPacket16& packet, Sums& sums, RayCounters& counters) const;
  OpennessEstimate judge(const Sums& sums) const;
};

namespace {

double reach_of(const OpennessParameters& p) {
  if (p.falloff != Falloff::exponential) return p.max_distance;
  return std::min(p.max_distance, kExponentialReach * p.falloff_distance);
}

}  // namespace

OpennessKernel::Impl::Impl(const Tracer& tracer_, const OpennessParameters& p)
    : tracer(&tracer_),
      parameters(p),
      t_far(static_cast<float>(reach_of(p))),
      points(hash_combine(p.seed, static_cast<uint64_t>(DimensionSet::ao_direction)),
             static_cast<uint32_t>(p.min_samples / kReplicates),
             static_cast<uint32_t>(p.max_samples / kReplicates)),
      quantile_95(student_t(0.95, kReplicates - 1)) {}

// Every ray starts at a facet's origin, leaves into the half-space above it and ends within reach:
// all of them stay in one sphere and above their planes.
bool OpennessKernel::Impl::surely_open(std::span<const Facet> facets, RayCounters& counters) const {
  if (!parameters.certificates || t_far == INFINITY) return false;
  std::vector<HalfSpace> above;
  float spread = 0;
  for (const Facet& facet : facets) {
    above.push_back({facet.origin, facet.normal});
    spread = std::max(spread, length(facet.origin - facets[0].origin));
  }
  return tracer->surely_clear(facets[0].origin, 1.0001f * (t_far + spread), above, counters);
}

Look OpennessKernel::Impl::look_from(const OpennessElement& element) const {
  Look look;
  look.facets = element.facets;
  const uint64_t shifts =
      hash_combine(parameters.seed, static_cast<uint64_t>(DimensionSet::ao_shift));
  look.masks = ReplicateMasks(hash_combine(shifts, element.id));
  double total = 0;
  for (const Facet& facet : element.facets) {
    look.bases.push_back(make_basis(facet.normal));
    total += facet.weight;
  }
  double sum = 0;
  for (const Facet& facet : element.facets) {
    sum += facet.weight;
    look.thresholds.push_back(
        static_cast<uint32_t>(std::min(std::floor(sum / total * 0x1p32), 0x1p32 - 1)));
  }
  look.thresholds.back() = 0xffffffffu;
  return look;
}

namespace {

// The first facet whose threshold lies above z. Few facets are the rule, a fan of many the
// exception.
size_t facet_at(const Look& look, uint32_t z) {
  const size_t last = look.thresholds.size() - 1;
  if (last < 16) {
    size_t f = 0;
    while (f < last && z >= look.thresholds[f]) ++f;
    return f;
  }
  const auto above = std::upper_bound(look.thresholds.begin(), look.thresholds.end(), z);
  return std::min(static_cast<size_t>(above - look.thresholds.begin()), last);
}

// Fills the packet's rays for one cell: lane r looks along replicate r's point, from the facet that
// the point's third coordinate chooses.
void aim(const Look& look, const CellPoints& cell, Distribution distribution, RayPacket16& packet) {
  float x[kPacketLanes], y[kPacketLanes], z[kPacketLanes];
  if (distribution == Distribution::cosine) {
    cosine_hemisphere(cell, x, y, z);
  } else {
    uniform_hemisphere(cell, x, y, z);
  }
  if (look.bases.size() == 1) {
    const Basis<float>& b = look.bases[0];
    for (size_t i = 0; i < kPacketLanes; ++i) {
      packet.direction_x[i] = b.tangent.x * x[i] + b.bitangent.x * y[i] + b.normal.x * z[i];
      packet.direction_y[i] = b.tangent.y * x[i] + b.bitangent.y * y[i] + b.normal.y * z[i];
      packet.direction_z[i] = b.tangent.z * x[i] + b.bitangent.z * y[i] + b.normal.z * z[i];
    }
    return;
  }
  for (size_t i = 0; i < kPacketLanes; ++i) {
    const size_t f = facet_at(look, cell.z[i]);
    const Vec3 direction = look.bases[f].to_world({x[i], y[i], z[i]});
    const Vec3& origin = look.facets[f].origin;
    packet.origin_x[i] = origin.x;
    packet.origin_y[i] = origin.y;
    packet.origin_z[i] = origin.z;
    packet.direction_x[i] = direction.x;
    packet.direction_y[i] = direction.y;
    packet.direction_z[i] = direction.z;
  }
}

}  // namespace

void OpennessKernel::Impl::trace(const RayPacket16& packet, Sums& sums,
                                 RayCounters& counters) const {
  if (parameters.falloff == Falloff::none) {
    counters.occlusion_rays += kPacketLanes;
    const uint32_t open = ~tracer->occluded16(packet, counters);
    for (size_t i = 0; i < kPacketLanes; ++i)
      sums.openness[i] += static_cast<double>(open >> i & 1u);
    return;
  }
  counters.nearest_rays += kPacketLanes;
  float t_hit[kPacketLanes];
  tracer->nearest16(packet, t_hit, counters);
  for (size_t i = 0; i < kPacketLanes; ++i)
    sums.openness[i] +=
        t_hit[i] == INFINITY
            ? 1.0
            : std::min(1.0, falloff_weight(parameters, static_cast<double>(t_hit[i])));
}

template <typename Each>
void OpennessKernel::Impl::each_packet(const Look& look, int level, const Each& each) const {
  const HemispherePoints::Block& block = points.block(level);
  RayPacket16 packet;
  const Vec3& origin = look.facets[0].origin;
  for (size_t i = 0; i < kPacketLanes; ++i) {
    packet.origin_x[i] = origin.x;
    packet.origin_y[i] = origin.y;
    packet.origin_z[i] = origin.z;
    packet.t_near[i] = 0;
    packet.t_far[i] = t_far;
    packet.valid[i] = -1;
  }
  const CellShifts shifts(look.masks, block);
  CellPoints cell;
  for (uint32_t c = 0; c < block.cells; ++c) {
    block.read(c, look.masks, shifts, &cell);
    aim(look, cell, parameters.distribution, packet);
    each(packet);
  }
}

void OpennessKernel::Impl::run_level(const Look& look, Sums& sums, RayCounters& counters) const {
  const uint64_t rejected_before = counters.rejected_rays;
  each_packet(look, sums.level, [&](const RayPacket16& packet) { trace(packet, sums, counters); });
  sums.points += points.block(sums.level).cells;
  ++sums.level;
  sums.rejected |= counters.rejected_rays != rejected_before;
}

OpennessEstimate OpennessKernel::Impl::judge(const Sums& sums) const {
  std::array<double, kReplicates> means;
  double mean = 0;
  for (size_t r = 0; r < means.size(); ++r) {
    means[r] = sums.openness[r] / static_cast<double>(sums.points);
    mean += means[r];
  }
  const uint64_t samples = sums.points * kReplicates;
  OpennessEstimate estimate;
  estimate.openness = mean / kReplicates;
  estimate.samples = static_cast<uint32_t>(samples);
  estimate.standard_error = bounded_standard_error(means, samples);
  estimate.half_width = quantile_95 * estimate.standard_error;
  estimate.status = sums.rejected ? AccuracyStatus::suspicious
                    : look_quantile(sums.level) * estimate.standard_error <= parameters.target_error
                        ? AccuracyStatus::converged
                        : AccuracyStatus::budget_limited;
  return estimate;
}

OpennessKernel::OpennessKernel(const Tracer& tracer, const OpennessParameters& parameters)
    : impl_(std::make_unique<Impl>(tracer, parameters)) {}
OpennessKernel::~OpennessKernel() = default;

std::vector<RayPacket16> OpennessKernel::packets(const OpennessElement& element, int level) const {
  std::vector<RayPacket16> all;
  impl_->each_packet(impl_->look_from(element), level,
                     [&](const RayPacket16& packet) { all.push_back(packet); });
  return all;
}

double OpennessKernel::reach() const {
  return reach_of(impl_->parameters);
}

void OpennessKernel::estimate(std::span<const OpennessElement> elements,
                              std::span<OpennessEstimate> estimates, ChunkReport* report,
                              const Progress& progress,
                              std::vector<std::vector<double>>* history) const {
  const FlushDenormals guard;
  const double start_s = thread_cpu_seconds();
  std::vector<Look> looks(elements.size());
  std::vector<Sums> sums(elements.size());
  std::vector<size_t> active;
  for (size_t i = 0; i < elements.size(); ++i) {
    estimates[i] = {};
    if (elements[i].facets.empty() || impl_->surely_open(elements[i].facets, report->counters))
      continue;
    looks[i] = impl_->look_from(elements[i]);
    active.push_back(i);
  }
  report->elements = elements.size();
  double last_s = start_s;
  while (!active.empty()) {
    Round round;
    round.elements = active.size();
    std::vector<size_t> next;
    for (const size_t i : active) {
      progress.check();
      const uint64_t before = sums[i].points;
      impl_->run_level(looks[i], sums[i], report->counters);
      estimates[i] = impl_->judge(sums[i]);
      round.rays += (sums[i].points - before) * kReplicates;
      round.samples = estimates[i].samples;
      if (estimates[i].status == AccuracyStatus::budget_limited &&
          estimates[i].samples < impl_->parameters.max_samples)
        next.push_back(i);
    }
    for (const OpennessEstimate& e : estimates) {
      round.error_sum_sq += e.half_width * e.half_width;
      round.error_max = std::max(round.error_max, e.half_width);
      round.converged += e.status == AccuracyStatus::converged || e.status == AccuracyStatus::exact;
    }
    const double now_s = thread_cpu_seconds();
    round.cpu_s = now_s - last_s;
    last_s = now_s;
    report->rounds.push_back(round);
    if (history) {
      std::vector<double>& errors = history->emplace_back();
      for (const OpennessEstimate& e : estimates) errors.push_back(e.standard_error);
    }
    active = std::move(next);
  }
  for (const OpennessEstimate& e : estimates) {
    report->suspicious += e.status == AccuracyStatus::suspicious;
    report->budget_limited += e.status == AccuracyStatus::budget_limited;
  }
  report->cpu_s = thread_cpu_seconds() - start_s;
}

}  // namespace lightkiln

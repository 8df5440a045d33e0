// A source is what a flood from the brightest texel reaches before it would spill: texels join in
// the order of their luminance, the brightest neighbour first, so that the texels above any level
// are one run of that order. The source is cut at the lowest level at which the run still lies
// within the allowed radius of its own centre, and not below twice the median of its surroundings.
// A lamp in a window, a bright cloud or a reflecting road all spill at a level near their peak,
// which the contrast of peak to cut tells.

#include "core/environment/bright_source.h"

#include <queue>

#include "core/base/text.h"

namespace lightkiln {

namespace {

constexpr double kCutOverMedian = 2;    // of the surroundings' luminance
constexpr double kCutUnderPeak = 1e-4;  // where the surroundings are black
constexpr double kLevelStep = 0.84;     // levels tried, a quarter of a stop apart
constexpr int kMaxPlateaus = 16;        // tied for the brightest; as in a clipped map

// Calls visit(texel) for all texels whose centre lies within `radius` of `centre`.
template <typename Visit>
void for_cap(const LatlongGrid& grid, const Vec3d& centre, double radius, const Visit& visit) {
  const double colatitude = std::acos(std::clamp(centre.y, -1.0, 1.0));
  const double rows = grid.height() / kPi;
  const int first = std::max(0, static_cast<int>((colatitude - radius) * rows) - 1);
  const int last = std::min(grid.height() - 1, static_cast<int>((colatitude + radius) * rows) + 1);
  for (int y = first; y <= last; ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      if (angle_between(grid.direction({x, y}), centre) <= radius) visit(Texel{x, y});
    }
  }
}

// Texels in the order in which the flood took them, each with the lowest luminance that the flood
// had come down to: the connected texels above a level are those before the first lower one.
struct Flood {
  std::vector<Texel> texels;
  std::vector<double> levels;
  double spill = 0;  // the level at which it left the reach; 0 = it never did
};

// Floods from `seed` down to `floor`, as long as it stays within `reach` of the seed. `taken` has a
// byte a texel, all 0 before and after.
Flood flood_from(const LatlongGrid& grid, Texel seed, double floor, double reach,
                 std::vector<uint8_t>& taken) {
  struct Candidate {
    double luminance;
    uint64_t order;  // first come, first served among equals
    Texel texel;
    bool operator<(const Candidate& other) const {
      return luminance != other.luminance ? luminance < other.luminance : order > other.order;
    }
  };
  const Vec3d start = grid.direction(seed);
  Flood flood;
  std::vector<Texel> touched{seed};
  std::priority_queue<Candidate> border;
  border.push({grid.luminance_at(seed), 0, seed});
  taken[grid.index(seed)] = 1;
  double level = grid.luminance_at(seed);
  while (!border.empty() && border.top().luminance >= floor) {
    const Candidate next = border.top();
    border.pop();
    level = std::min(level, next.luminance);
    if (angle_between(grid.direction(next.texel), start) > reach) {
      flood.spill = level;
      break;
    }
    flood.texels.push_back(next.texel);
    flood.levels.push_back(level);
    for (const Texel t : grid.neighbours(next.texel)) {
      uint8_t& mark = taken[grid.index(t)];
      if (mark) continue;
      mark = 1;
      border.push({grid.luminance_at(t), touched.size(), t});
      touched.push_back(t);
    }
  }
  for (const Texel t : touched) taken[grid.index(t)] = 0;
  return flood;
}

// The farthest texel centre from the luminous centre of the first `count` texels.
double extent(const LatlongGrid& grid, const Flood& flood, size_t count) {
  Vec3d moment;
  for (size_t i = 0; i < count; ++i) {
    moment += grid.moment(flood.texels[i]) * grid.luminance_at(flood.texels[i]);
  }
  if (!(length(moment) > 0)) return kPi;
  const Vec3d centre = normalize(moment);
  double farthest = 0;
  for (size_t i = 0; i < count; ++i) {
    farthest = std::max(farthest, angle_between(grid.direction(flood.texels[i]), centre));
  }
  return farthest;
}

struct Cut {
  size_t count = 0;  // texels of the flood; 0 = even the brightest reach too far
  double level = 0;
};

// The lowest level at which the flood is still compact.
Cut cut_flood(const LatlongGrid& grid, const Flood& flood, double floor, double max_radius) {
  Cut cut;
  for (double level = flood.levels.front();; level = std::max(floor, level * kLevelStep)) {
    if (level <= flood.spill) break;
    const auto end = std::partition_point(flood.levels.begin(), flood.levels.end(),
                                          [level](double l) { return l >= level; });
    const auto count = static_cast<size_t>(end - flood.levels.begin());
    if (count != cut.count && extent(grid, flood, count) > max_radius) break;
    cut = {count, level};
    if (level <= floor) break;
  }
  return cut;
}

// Half of the surroundings, by solid angle, are darker.
double median_around(const LatlongGrid& grid, const Vec3d& centre, double inner, double outer) {
  std::vector<std::pair<double, double>> values;  // luminance, solid angle
  double total = 0;
  for_cap(grid, centre, outer, [&](Texel t) {
    if (angle_between(grid.direction(t), centre) <= inner) return;
    values.emplace_back(grid.luminance_at(t), grid.solid_angle(t));
    total += values.back().second;
  });
  std::sort(values.begin(), values.end());
  double sum = 0;
  for (const auto& [value, weight] : values) {
    sum += weight;
    if (2 * sum >= total) return value;
  }
  return 0;
}

// One texel of each connected set of texels at the map's maximum, the largest set first.
std::vector<Texel> brightest_plateaus(const LatlongGrid& grid, double peak,
                                      std::vector<uint8_t>& taken) {
  std::vector<std::pair<double, Texel>> found;
  std::vector<Texel> members;
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      const Texel seed{x, y};
      if (grid.luminance_at(seed) < peak || taken[grid.index(seed)]) continue;
      double area = 0;
      const size_t first = members.size();
      members.push_back(seed);
      taken[grid.index(seed)] = 1;
      for (size_t i = first; i < members.size(); ++i) {
        area += grid.solid_angle(members[i]);
        for (const Texel t : grid.neighbours(members[i])) {
          if (taken[grid.index(t)] || grid.luminance_at(t) < peak) continue;
          taken[grid.index(t)] = 1;
          members.push_back(t);
        }
      }
      found.emplace_back(area, seed);
    }
  }
  for (const Texel t : members) taken[grid.index(t)] = 0;
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  if (found.size() > kMaxPlateaus) found.resize(kMaxPlateaus);
  std::vector<Texel> seeds;
  for (const auto& [area, seed] : found) seeds.push_back(seed);
  return seeds;
}

std::string degrees(double angle_rad) {
  return short_number(angle_rad * 180 / kPi) + " degrees";
}

BrightSource source_at(const LatlongGrid& grid, Texel seed, double peak, const SourceLimits& limits,
                       std::vector<uint8_t>& taken) {
  BrightSource source;
  source.peak = peak;
  const double radius = limits.max_angular_radius_rad, texel = kPi / grid.height();
  const double outer = 2 * (radius + texel);
  const double around = median_around(grid, grid.direction(seed), radius, outer);
  const double floor = std::max(kCutOverMedian * around, kCutUnderPeak * peak);
  if (peak < floor * limits.min_contrast) {
    source.reason = "The brightest texel is only " + short_number(peak / around) +
                    " times as bright as the median within " + degrees(outer) + " of it.";
    return source;
  }
  const Flood flood = flood_from(grid, seed, floor, 2 * radius + texel, taken);
  const Cut cut = cut_flood(grid, flood, floor, radius);
  if (cut.count == 0) {
    source.reason = "The brightest texels themselves reach farther than " + degrees(radius) + ".";
  } else if (peak < cut.level * limits.min_contrast) {
    source.reason = "The brightest texels belong to something wider: what is within " +
                    degrees(radius) + " stands out by a factor of " +
                    short_number(peak / cut.level) + " only, under the ordered " +
                    short_number(limits.min_contrast) + ".";
  } else {
    source.cut = cut.level;
    source.texels.assign(flood.texels.begin(),
                         flood.texels.begin() + static_cast<ptrdiff_t>(cut.count));
  }
  return source;
}

}  // namespace

std::vector<BrightSource> bright_sources(const LatlongGrid& grid, double peak,
                                         const SourceLimits& limits) {
  std::vector<uint8_t> taken(static_cast<size_t>(grid.width()) *
                             static_cast<size_t>(grid.height()));
  std::vector<BrightSource> sources;
  for (const Texel seed : brightest_plateaus(grid, peak, taken)) {
    sources.push_back(source_at(grid, seed, peak, limits, taken));
  }
  return sources;
}

}  // namespace lightkiln

#include "core/environment/light_set.h"

#include <algorithm>
#include <numeric>
#include <queue>

#include "core/base/parallel.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

constexpr int kLloydRounds = 24;

// Weight and first moment of a set of cells. The variance of direction in it, int w |d - mean|^2,
// is int w |d|^2 - |moment|^2 / weight, of which only the second term depends on the division.
struct Mass {
  double weight = 0;
  Vec3d moment;

  void add(const LightCell& cell) {
    weight += cell.weight;
    moment += cell.centre * cell.weight;
  }
  double concentration() const { return weight > 0 ? dot(moment, moment) / weight : 0; }
};

// A run of the cells' order that is one light, and the best way to divide it.
struct Region {
  size_t begin = 0, end = 0;
  size_t middle = 0;            // begin = it cannot be divided
  double gain = 0;              // what dividing it is worth
  std::vector<uint32_t> order;  // of its cells, as the division needs it

  bool operator<(const Region& other) const {
    return gain != other.gain ? gain < other.gain : begin > other.begin;
  }
};

class Splitter {
 public:
  Splitter(const LightCells& light, LightSplit split) : light_(light), split_(split) {
    order_.resize(light.cells.size());
    std::iota(order_.begin(), order_.end(), 0u);
    if (split == LightSplit::median_cut) {
      for (const LightCell& cell : light.cells) {
        double u = 0, v = 0;
        latlong_coordinates(normalize(cell.centre), &u, &v);
        longitude_.push_back(2 * kPi * u);
        colatitude_.push_back(kPi * v);
      }
    }
  }

  // The light of each cell.
  std::vector<uint32_t> run(int count) {
    std::vector<uint32_t> owner(order_.size());
    if (order_.empty()) return owner;
    std::priority_queue<Region> regions;
    regions.push(region(0, order_.size()));
    std::vector<Region> done;
    while (!regions.empty() && static_cast<int>(regions.size() + done.size()) < count) {
      Region next = regions.top();
      regions.pop();
      if (next.middle == next.begin) {
        done.push_back(std::move(next));
        continue;
      }
      std::copy(next.order.begin(), next.order.end(),
                order_.begin() + static_cast<ptrdiff_t>(next.begin));
      regions.push(region(next.begin, next.middle));
      regions.push(region(next.middle, next.end));
    }
    uint32_t index = 0;
    const auto own = [&](const Region& r) {
      for (size_t i = r.begin; i < r.end; ++i) owner[order_[i]] = index;
      ++index;
    };
    for (const Region& r : done) own(r);
    for (; !regions.empty(); regions.pop()) own(regions.top());
    return owner;
  }

 private:
  const LightCell& cell(uint32_t i) const { return light_.cells[i]; }

  Region region(size_t begin, size_t end) const {
    Region r;
    r.begin = r.middle = begin;
    r.end = end;
    if (end - begin < 2) return r;
    r.order.assign(order_.begin() + static_cast<ptrdiff_t>(begin),
                   order_.begin() + static_cast<ptrdiff_t>(end));
    split_ == LightSplit::median_cut ? halve(&r) : part(&r);
    return r;
  }

  void sort(std::vector<uint32_t>* cells, const std::vector<double>& key) const {
    std::sort(cells->begin(), cells->end(),
              [&](uint32_t a, uint32_t b) { return key[a] != key[b] ? key[a] < key[b] : a < b; });
  }

  // Across the longer side, longitudes counted at the middle latitude.
  void halve(Region* r) const {
    double u0 = 7, u1 = 0, v0 = 4, v1 = 0, total = 0;
    for (const uint32_t i : r->order) {
      u0 = std::min(u0, longitude_[i]);
      u1 = std::max(u1, longitude_[i]);
      v0 = std::min(v0, colatitude_[i]);
      v1 = std::max(v1, colatitude_[i]);
      total += cell(i).weight;
    }
    const bool wide = (u1 - u0) * std::sin((v0 + v1) / 2) > v1 - v0;
    sort(&r->order, wide ? longitude_ : colatitude_);
    double sum = 0;
    size_t count = 0;
    while (count + 1 < r->order.size() && 2 * sum < total) sum += cell(r->order[count++]).weight;
    r->middle = r->begin + std::max<size_t>(1, count);
    r->gain = total;
  }

  // Across the axis along which directions vary most, where the parts' concentrations sum highest.
  void part(Region* r) const {
    Mass all;
    for (const uint32_t i : r->order) all.add(cell(i));
    const Vec3d axis = principal_axis(*r, all);
    std::vector<std::pair<double, uint32_t>> along;
    for (const uint32_t i : r->order) along.emplace_back(dot(cell(i).centre, axis), i);
    std::sort(along.begin(), along.end());
    Mass left;
    double best = -1;
    for (size_t i = 0; i + 1 < along.size(); ++i) {
      r->order[i] = along[i].second;
      left.add(cell(along[i].second));
      const Mass right{all.weight - left.weight, all.moment - left.moment};
      const double both = left.concentration() + right.concentration();
      if (both <= best) continue;
      best = both;
      r->middle = r->begin + i + 1;
    }
    r->order.back() = along.back().second;
    r->gain = best - all.concentration();
  }

  // Power iteration on the covariance of directions.
  Vec3d principal_axis(const Region& r, const Mass& all) const {
    const Vec3d mean = all.moment / all.weight;
    double c[3][3] = {};
    for (const uint32_t i : r.order) {
      const Vec3d d = cell(i).centre - mean;
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) c[a][b] += cell(i).weight * d[a] * d[b];
      }
    }
    int widest = 0;
    for (int a = 1; a < 3; ++a) widest = c[a][a] > c[widest][widest] ? a : widest;
    Vec3d axis{c[0][widest], c[1][widest], c[2][widest]};
    for (int round = 0; round < 32 && dot(axis, axis) > 0; ++round) {
      axis = normalize(axis);
      const Vec3d next{c[0][0] * axis.x + c[0][1] * axis.y + c[0][2] * axis.z,
                       c[1][0] * axis.x + c[1][1] * axis.y + c[1][2] * axis.z,
                       c[2][0] * axis.x + c[2][1] * axis.y + c[2][2] * axis.z};
      axis = next;
    }
    return dot(axis, axis) > 0 ? normalize(axis) : Vec3d{1, 0, 0};
  }

  const LightCells& light_;
  LightSplit split_;
  std::vector<uint32_t> order_;
  std::vector<double> longitude_, colatitude_;
};

std::vector<Mass> masses(const LightCells& light, const std::vector<uint32_t>& owner) {
  uint32_t count = 0;
  for (const uint32_t o : owner) count = std::max(count, o + 1);
  std::vector<Mass> result(count);
  for (size_t i = 0; i < owner.size(); ++i) result[owner[i]].add(light.cells[i]);
  return result;
}

// For each mean the others, nearest first.
using Neighbours = std::vector<std::vector<std::pair<double, uint32_t>>>;
Neighbours neighbours_of(const std::vector<Vec3d>& means) {
  Neighbours near(means.size());
  for (uint32_t a = 0; a < means.size(); ++a) {
    for (uint32_t b = 0; b < means.size(); ++b) {
      if (a != b) near[a].emplace_back(length(means[a] - means[b]), b);
    }
    std::sort(near[a].begin(), near[a].end());
  }
  return near;
}

// The mean nearest to `d`, which is now with mean `owner` at a distance r: no mean farther than 2 r
// from that one can be nearer.
uint32_t nearest_mean(const Vec3d& d, uint32_t owner, const std::vector<Vec3d>& means,
                      const Neighbours& near) {
  const auto square = [&](uint32_t k) { return dot(d - means[k], d - means[k]); };
  double least = square(owner);
  const double reach = 2 * std::sqrt(least);
  uint32_t best = owner;
  for (const auto& [apart, k] : near[owner]) {
    if (apart > reach) break;
    const double s = square(k);
    if (s >= least) continue;
    least = s;
    best = k;
  }
  return best;
}

// Each cell goes to the nearest mean, each mean to the middle of its cells: int w |d - mean|^2
// falls in every round (Lloyd, "Least squares quantization in PCM", 1982).
void iterate(const LightCells& light, std::vector<uint32_t>* owner, int threads,
             Progress& progress) {
  for (int round = 0; round < kLloydRounds; ++round) {
    std::vector<Vec3d> means;
    for (const Mass& m : masses(light, *owner)) {
      // A light that lost its last cell stays where no direction is near.
      means.push_back(m.weight > 0 ? m.moment / m.weight : Vec3d{9, 9, 9});
    }
    const Neighbours near = neighbours_of(means);
    std::vector<uint32_t> next(owner->size());
    parallel_blocks(next.size(), 4096, threads, progress, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        next[i] = nearest_mean(light.cells[i].centre, (*owner)[i], means, near);
      }
    });
    if (next == *owner) return;
    *owner = std::move(next);
  }
}

}  // namespace

std::vector<DirectionalLight> split_lights(const LightCells& light, int count, LightSplit split,
                                           int threads, Progress& progress) {
  std::vector<uint32_t> owner = Splitter(light, split).run(count);
  if (split == LightSplit::clusters) iterate(light, &owner, threads, progress);
  const std::vector<Mass> groups = masses(light, owner);
  std::vector<DirectionalLight> lights(groups.size());
  for (size_t i = 0; i < owner.size(); ++i) lights[owner[i]].irradiance += light.cells[i].energy;
  for (size_t i = 0; i < groups.size(); ++i) {
    // Directions that cancel have no middle: any will do.
    const double far = length(groups[i].moment);
    lights[i].direction = far > 0 ? groups[i].moment / far : Vec3d{0, 1, 0};
  }
  std::erase_if(lights, [](const DirectionalLight& l) { return l.irradiance == Vec3d{}; });
  std::stable_sort(lights.begin(), lights.end(), [](const auto& a, const auto& b) {
    return luminance(a.irradiance) > luminance(b.irradiance);
  });
  return lights;
}

Vec3d light_irradiance(std::span<const DirectionalLight> lights, const Vec3d& normal) {
  Vec3d sum;
  for (const DirectionalLight& light : lights) {
    sum += light.irradiance * std::max(0.0, dot(normal, light.direction));
  }
  return sum;
}

// Normals on a spiral of equal areas (Gonzalez, "Measurement of Areas on a Sphere Using Fibonacci
// and Latitude-Longitude Lattices", 2010). The clamped cosine averages 1/4 over the sphere.
IrradianceReference::IrradianceReference(const LightCells& light, int threads, Progress& progress)
    : normals_(kNormals), irradiance_(kNormals), mean_(light.weight / 4) {
  const double golden = kPi * (3 - std::sqrt(5.0));
  for (int i = 0; i < kNormals; ++i) {
    const double z = 1 - (2 * i + 1.0) / kNormals, r = std::sqrt(1 - z * z);
    normals_[static_cast<size_t>(i)] = {r * std::cos(golden * i), r * std::sin(golden * i), z};
  }
  parallel_blocks(kNormals, 32, threads, progress, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) irradiance_[i] = cell_irradiance(light, normals_[i]);
  });
}

IrradianceError IrradianceReference::error(std::span<const DirectionalLight> lights) const {
  IrradianceError error;
  if (!(mean_ > 0)) return error;
  double squares = 0;
  for (size_t i = 0; i < normals_.size(); ++i) {
    const Vec3d apart = (light_irradiance(lights, normals_[i]) - irradiance_[i]) / mean_;
    squares += dot(apart, apart);
    for (int c = 0; c < 3; ++c) error.max = std::max(error.max, std::abs(apart[c]));
  }
  error.rms = std::sqrt(squares / (3.0 * static_cast<double>(normals_.size())));
  return error;
}

}  // namespace lightkiln

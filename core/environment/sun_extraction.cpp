// The disk: a uniform disk of solid angle W and luminance l has int l = l W and int l^2 = l^2 W,
// hence W = (int l)^2 / int l^2, which weighs the core and not the skirts that a lens adds, gives a
// clipped sun its plateau and a sun of one texel that texel's solid angle.

#include "core/environment/sun_extraction.h"

#include <algorithm>
#include <vector>

#include "core/base/text.h"
#include "core/environment/bright_source.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

constexpr double kMaxElongation = 4;  // length to width; a tube is no disk
constexpr int kSectors = 64;          // of the rim that the hole is filled from

// What fills the hole: the rim's texels gathered by azimuth about the centre, each sector with its
// mean radiance and mean direction, and weighed by solid angle over squared distance.
class Rim {
 public:
  Rim(const LatlongGrid& grid, const std::vector<Texel>& hole, const Vec3d& centre) {
    std::vector<uint8_t> taken(static_cast<size_t>(grid.width()) *
                               static_cast<size_t>(grid.height()));
    const Basis<double> basis = make_basis(centre);
    for (const Texel t : hole) taken[grid.index(t)] = 1;
    for (const Texel t : hole) {
      for (const Texel n : grid.neighbours(t)) {
        if (taken[grid.index(n)]) continue;
        taken[grid.index(n)] = 1;
        const Vec3d d = grid.direction(n);
        const double azimuth = std::atan2(dot(d, basis.bitangent), dot(d, basis.tangent));
        Sector& sector =
            sectors_[static_cast<size_t>((azimuth / (2 * kPi) + 0.5) * kSectors) % sectors_.size()];
        sector.radiance += grid.radiance(n) * grid.solid_angle(n);
        sector.direction += grid.moment(n);
        sector.solid_angle += grid.solid_angle(n);
      }
    }
    std::erase_if(sectors_, [](const Sector& s) { return !(s.solid_angle > 0); });
    for (Sector& s : sectors_) {
      s.radiance = s.radiance / s.solid_angle;
      s.direction = s.direction / s.solid_angle;
    }
  }

  bool empty() const { return sectors_.empty(); }
  Vec3d at(const Vec3d& direction) const {
    Vec3d sum;
    double weights = 0;
    for (const Sector& s : sectors_) {
      const Vec3d apart = s.direction - direction;
      const double weight = s.solid_angle / std::max(1e-12, dot(apart, apart));
      sum += s.radiance * weight;
      weights += weight;
    }
    return sum / weights;
  }

 private:
  struct Sector {
    Vec3d radiance, direction;
    double solid_angle = 0;
  };
  std::vector<Sector> sectors_ = std::vector<Sector>(kSectors);
};

// What the source holds above its fill.
struct Excess {
  Vec3d energy;
  Vec3d moment;                  // luminance times direction
  double first = 0, second = 0;  // int l, int l^2
};

// Length to width of the source, from the standard deviations of its luminance along and across;
// half a row's height in both keeps a single texel near a pole round.
double elongation(const LatlongGrid& grid, const std::vector<Texel>& texels,
                  const std::vector<double>& weights, const Vec3d& centre) {
  const Basis<double> basis = make_basis(centre);
  const double row = kPi / grid.height();
  double xx = 0, xy = 0, yy = 0, total = 0;
  for (size_t i = 0; i < texels.size(); ++i) {
    const Vec3d d = grid.direction(texels[i]);
    const double x = dot(d, basis.tangent), y = dot(d, basis.bitangent);
    xx += weights[i] * x * x;
    xy += weights[i] * x * y;
    yy += weights[i] * y * y;
    total += weights[i];
  }
  const double mean = (xx + yy) / 2, spread = std::hypot((xx - yy) / 2, xy);
  const double base = total * row * row / 12;
  return std::sqrt((mean + spread + base) / (std::max(0.0, mean - spread) + base));
}

std::string degrees(double angle_rad) {
  return short_number(angle_rad * 180 / kPi) + " degrees";
}

// A source that may be taken out, and what stays in its texels' place.
struct Candidate {
  SunExtraction sun;
  std::vector<Vec3> fill;
};

// Measures the source's texels against their fill.
Candidate measure(const LatlongGrid& grid, const BrightSource& source, double max_radius_rad) {
  Candidate candidate;
  SunExtraction& sun = candidate.sun;
  const std::vector<Texel>& texels = source.texels;
  Vec3d moment;
  for (const Texel t : texels) moment += grid.moment(t) * grid.luminance_at(t);
  const Rim rim(grid, texels, normalize(moment));
  if (rim.empty()) {
    sun.reason = "The map is too small to have surroundings of a source.";
    return candidate;
  }
  Excess excess;
  std::vector<double> weights;
  for (const Texel t : texels) {
    const Vec3d whole = grid.radiance(t), around = rim.at(grid.direction(t));
    const Vec3 fill = to_float(
        {std::min(whole.x, around.x), std::min(whole.y, around.y), std::min(whole.z, around.z)});
    candidate.fill.push_back(fill);
    const Vec3d over = whole - to_double(fill);
    const double l = luminance(over), solid_angle = grid.solid_angle(t);
    excess.energy += over * solid_angle;
    excess.moment += grid.moment(t) * l;
    excess.first += l * solid_angle;
    excess.second += l * l * solid_angle;
    weights.push_back(l * solid_angle);
  }
  if (!(excess.first > 0)) {
    sun.reason = "The brightest texels are no brighter than what surrounds them.";
    return candidate;
  }
  const double solid_angle = excess.first * excess.first / excess.second;
  sun.disk.direction = normalize(excess.moment);
  sun.disk.angular_radius_rad = 2 * std::asin(std::min(1.0, std::sqrt(solid_angle / (4 * kPi))));
  sun.disk.radiance = excess.energy / solid_angle;
  sun.texels = texels.size();
  for (const Texel t : texels) {
    sun.extent_rad = std::max(sun.extent_rad, angle_between(grid.direction(t), sun.disk.direction));
  }
  sun.contrast = source.peak / source.cut;
  const double ratio = elongation(grid, texels, weights, sun.disk.direction);
  if (sun.disk.angular_radius_rad > max_radius_rad) {
    sun.reason = "The brightest texels are as wide as a disk of radius " +
                 degrees(sun.disk.angular_radius_rad) + ", over the limit of " +
                 degrees(max_radius_rad) + ".";
  } else if (ratio > kMaxElongation) {
    sun.reason = "The brightest source is " + short_number(ratio) +
                 " times as long as it is wide; a disk would not stand for it.";
  } else {
    sun.found = true;
    sun.reason = "The brightest source is " + short_number(sun.contrast) +
                 " times as bright as what surrounds it and as wide as a disk of radius " +
                 degrees(sun.disk.angular_radius_rad) + "; " + std::to_string(sun.texels) +
                 " texels within " + degrees(sun.extent_rad) + " gave what exceeds their rim.";
  }
  return candidate;
}

Vec3d integral(const Image& image) {
  Vec3d total;
  for (int y = 0; y < image.height; ++y) {
    Vec3d row;
    for (int x = 0; x < image.width; ++x) row += to_double(image.rgb(x, y));
    total += row * latlong_texel_solid_angle(y, image.width, image.height);
  }
  return total;
}

// Puts the fill in the source's place, and what follows from the pixels right.
void take_out(const LatlongGrid& grid, const BrightSource& source, const Candidate& candidate,
              Environment* environment) {
  Image& image = environment->radiance;
  for (size_t i = 0; i < source.texels.size(); ++i) {
    const Texel t = source.texels[i];
    std::copy_n(&candidate.fill[i].x, 3, image.at(t.x, t.y));
  }
  environment->source = Image();
  environment->reduced = true;
  const Vec3 first = image.rgb(0, 0);
  environment->constant = true;
  environment->max_luminance = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      environment->constant &= image.rgb(x, y) == first;
      environment->max_luminance = std::max(environment->max_luminance, grid.luminance_at({x, y}));
    }
  }
  environment->mean = environment->constant ? to_double(first) : integral(image) / (4 * kPi);
}

}  // namespace

Vec3d SunDisk::energy() const {
  return radiance * cap_solid_angle(angular_radius_rad);
}

// int cos theta over the cap: 2 pi int_0^a cos t sin t dt = pi sin^2 a.
Vec3d SunDisk::irradiance() const {
  const double sine = std::sin(angular_radius_rad);
  return radiance * (kPi * sine * sine);
}

SunExtraction extract_sun(Environment& environment, const SunOptions& options) {
  SunExtraction nothing;
  nothing.energy_before = nothing.energy_after = environment.mean * (4 * kPi);
  nothing.max_luminance_before = environment.max_luminance;
  if (environment.constant) {
    nothing.reason = "The map has one radiance everywhere.";
    return nothing;
  }
  const LatlongGrid grid(environment.radiance);
  const SourceLimits limits{options.max_angular_radius_rad, options.min_contrast};
  for (const BrightSource& source : bright_sources(grid, environment.max_luminance, limits)) {
    if (source.texels.empty()) {
      if (nothing.reason.empty()) nothing.reason = source.reason;
      continue;
    }
    Candidate candidate = measure(grid, source, limits.max_angular_radius_rad);
    if (candidate.sun.found) {
      take_out(grid, source, candidate, &environment);
      candidate.sun.energy_before = nothing.energy_before;
      candidate.sun.max_luminance_before = nothing.max_luminance_before;
      candidate.sun.energy_after = environment.mean * (4 * kPi);
      return candidate.sun;
    }
    if (nothing.reason.empty()) nothing.reason = candidate.sun.reason;
  }
  return nothing;
}

// A cap of half-angle a about the pole has
//   Z_0 = 2 sqrt(pi) sin^2(a/2),  Z_l = sqrt(pi / (2l+1)) (P_{l-1}(cos a) - P_{l+1}(cos a)),
// and a zonal function about d has the coefficients Z_l sqrt(4 pi / (2l+1)) y_lm(d) (Sloan, "Stupid
// Spherical Harmonics Tricks", 2008). The difference cancels for a small sun; Legendre's equation
// turns it into (2l+1) sin^2 a P'_l(cos a) / (l (l+1)), which does not, so that
//   L_lm = 2 pi sin^2 a P'_l(cos a) / (l (l+1)) y_lm(d),  P'_{l+1} = P'_{l-1} + (2l+1) P_l.
ShRgb sun_harmonics(const SunDisk& disk, int bands) {
  ShRgb sh(bands);
  std::vector<double> basis(sh_coefficient_count(bands));
  sh_evaluate_basis(disk.direction, bands, basis);
  const double x = std::cos(disk.angular_radius_rad), sine = std::sin(disk.angular_radius_rad);
  double before = 0, now = 1;              // P_{l-1}, P_l
  double slope_before = 0, slope_now = 0;  // their derivatives
  for (int l = 0; l < bands; ++l) {
    const double share =
        l == 0 ? cap_solid_angle(disk.angular_radius_rad)
               : 2 * kPi * sine * sine * slope_now / (static_cast<double>(l) * (l + 1));
    for (int m = -l; m <= l; ++m) {
      sh.coefficients[sh_index(l, m)] = disk.radiance * (share * basis[sh_index(l, m)]);
    }
    const double slope_next = slope_before + (2 * l + 1) * now;
    const double next = ((2 * l + 1) * x * now - l * before) / (l + 1);
    before = now;
    now = next;
    slope_before = slope_now;
    slope_now = slope_next;
  }
  return sh;
}

}  // namespace lightkiln

// Sources: Parseval's theorem; Ramamoorthi & Hanrahan, "On the Relationship between Radiance and
// Irradiance", JOSA A 18(10), 2001 (irradiance as a product by band).

#include "core/sphere/harmonic_spectrum.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/parallel.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

Vec3d latlong_energy(const Image& map, int threads, Progress& progress) {
  std::vector<Vec3d> rows(static_cast<size_t>(map.height));
  parallel_blocks(rows.size(), 16, threads, progress, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      const float* p = map.at(0, static_cast<int>(y));
      double sum[3] = {0, 0, 0};
      for (int x = 0; x < map.width; ++x) {
        for (int c = 0; c < 3; ++c) {
          const double value = double(p[x * map.channels + c]);
          sum[c] += value * value;
        }
      }
      rows[y] = Vec3d{sum[0], sum[1], sum[2]} *
                latlong_texel_solid_angle(static_cast<int>(y), map.width, map.height);
    }
  });
  Vec3d total;
  for (const Vec3d& row : rows) total += row;
  return total;
}

namespace {

double largest(const Vec3d& a) {
  return std::max({a.x, a.y, a.z});
}
Vec3d positive(const Vec3d& a) {
  return {std::max(a.x, 0.0), std::max(a.y, 0.0), std::max(a.z, 0.0)};
}

// sum_{l >= first} A_l^2 (2l+1) / (4 pi): what a unit vector of coefficients beyond `first` can
// give at one direction, squared. All of it is 2 pi / 3, the integral of the squared cosine lobe.
double lobe_tail(int first) {
  double sum = 2 * kPi / 3;
  for (int l = 0; l < first; ++l) {
    const double a = clamped_cosine_band(l);
    sum -= a * a * (2 * l + 1) / (4 * kPi);
  }
  return std::max(sum, 0.0);
}

}  // namespace

// By Parseval an error's mean square is the energy it lacks over 4 pi. Irradiance has the factor
// A_l on band l, and |A_l| falls with even l (odd bands above 1 vanish). At one direction band l is
// off by at most A_l sqrt((2l+1) / 4 pi) |c_l| (addition theorem), and everything beyond the known
// bands by sqrt(lobe_tail) times the length of the unknown coefficients (Cauchy and Schwarz).
ShSpectrum make_spectrum(std::span<const Vec3d> energy, const Vec3d& total, const Vec3d& mean,
                         int rows) {
  assert(rows >= 1 && static_cast<size_t>(rows) <= energy.size());
  ShSpectrum spectrum;
  spectrum.total_energy = total;
  spectrum.mean = mean;
  const int known = static_cast<int>(energy.size());
  Vec3d sum;
  for (const Vec3d& band : energy) sum += band;
  const Vec3d beyond = positive(total - sum);
  const double beyond_factor =
      std::max(std::abs(clamped_cosine_band(known)), std::abs(clamped_cosine_band(known + 1)));
  // From the last band to the first, so that small energies are added first.
  Vec3d radiance = beyond, irradiance = beyond * (beyond_factor * beyond_factor);
  Vec3d peak{std::sqrt(beyond.x), std::sqrt(beyond.y), std::sqrt(beyond.z)};
  peak *= std::sqrt(lobe_tail(known));
  const double scale = luminance(mean);
  spectrum.rows.resize(static_cast<size_t>(rows));
  for (int l = known - 1; l >= 0; --l) {
    const Vec3d& band = energy[static_cast<size_t>(l)];
    if (l < rows) {
      BandRow& row = spectrum.rows[static_cast<size_t>(l)];
      row.bands = l + 1;
      row.energy = band;
      if (scale > 0) {
        row.radiance_rms = std::sqrt(largest(radiance) / (4 * kPi)) / scale;
        row.irradiance_rms = std::sqrt(largest(irradiance) / (4 * kPi)) / (kPi * scale);
        row.irradiance_max = largest(peak) / (kPi * scale);
      }
    }
    const double a = std::abs(clamped_cosine_band(l));
    radiance += band;
    irradiance += band * (a * a);
    peak += Vec3d{std::sqrt(band.x), std::sqrt(band.y), std::sqrt(band.z)} *
            (a * std::sqrt((2 * l + 1) / (4 * kPi)));
  }
  return spectrum;
}

BandAdvice advise_bands(const ShSpectrum& spectrum, double error) {
  BandAdvice advice{error, 0, 0};
  for (const BandRow& row : spectrum.rows) {
    if (advice.radiance_bands == 0 && row.radiance_rms <= error) advice.radiance_bands = row.bands;
    if (advice.irradiance_bands == 0 && row.irradiance_rms <= error)
      advice.irradiance_bands = row.bands;
  }
  return advice;
}

}  // namespace lightkiln

// Sources: the separation of variables of every fast spherical harmonic transform (Reinecke,
// "Libpsht: algorithms for efficient spherical harmonic transforms", A&A 526, 2011, section 2),
// with texels as boxes instead of points.

#include "core/sphere/harmonic_transform.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/instruction_sets.h"
#include "core/base/parallel.h"
#include "core/sphere/harmonic_rotation.h"
#include "core/sphere/legendre.h"
#include "core/sphere/quadrature.h"
#include "core/sphere/row_spectra.h"

namespace lightkiln {

namespace {

// Gauss nodes of the rows of a block: z = cos theta and weight sin(theta) dtheta.
struct BlockNodes {
  std::vector<Lanes> cosine, sine, weight;  // [point * kRowVectors + vector]
  double farthest = 0;                      // largest polar distance of the block
};
BlockNodes block_nodes(int block, int height, const GaussRule& rule) {
  const size_t count = rule.nodes.size() * kRowVectors;
  BlockNodes nodes{std::vector<Lanes>(count), std::vector<Lanes>(count), std::vector<Lanes>(count),
                   0};
  const double step = kPi / height;
  for (size_t point = 0; point < rule.nodes.size(); ++point) {
    for (int i = 0; i < kRowPairs; ++i) {
      const int row = std::min(block * kRowPairs + i, (height + 1) / 2 - 1);
      const double theta = step * (row + 0.5 + 0.5 * rule.nodes[point]);
      const size_t slot = point * kRowVectors + static_cast<size_t>(i / kLanes);
      nodes.cosine[slot].set(i % kLanes, std::cos(theta));
      nodes.sine[slot].set(i % kLanes, std::sin(theta));
      nodes.weight[slot].set(i % kLanes, 0.5 * step * rule.weights[point] * std::sin(theta));
      nodes.farthest = std::max(nodes.farthest, std::min(theta, kPi - theta));
    }
  }
  return nodes;
}

// All coefficients of order m: for each block of rows, the Legendre values of every band summed
// over the row's points meet the six sums or differences.
LIGHTKILN_CLONES void project_order(int m, const RowSpectra& spectra,
                                    const std::vector<BlockNodes>& nodes,
                                    const LegendreStart& start, LatlongSpectrum* spectrum) {
  const int bands = spectrum->bands;
  const LegendreStep step(m, bands);
  std::vector<Lanes> sums(static_cast<size_t>(bands - m) * 6, Lanes{});
  std::vector<Lanes> value, before;
  for (int block = 0; block < spectra.blocks; ++block) {
    const BlockNodes& at = nodes[static_cast<size_t>(block)];
    if (legendre_negligible(m, at.farthest, bands)) continue;
    const size_t count = at.cosine.size(), points = count / kRowVectors;
    value.assign(count, Lanes{});
    before.assign(count, Lanes{});
    for (size_t i = 0; i < count; ++i) {
      for (int lane = 0; lane < kLanes; ++lane) {
        value[i].set(lane, at.weight[i][lane] * start(m, at.sine[i][lane]));
      }
    }
    const Lanes* rows = spectra.at(m, block);
    for (int l = m; l < bands; ++l) {
      const size_t index = static_cast<size_t>(l - m);
      if (l > m) {
        const double grow = step.grow[index], keep = step.keep[index];
        for (size_t i = 0; i < count; ++i) {
          const Lanes next = at.cosine[i] * value[i] * grow - before[i] * keep;
          before[i] = value[i];
          value[i] = next;
        }
      }
      Lanes total[kRowVectors] = {};
      for (size_t point = 0; point < points; ++point) {
        for (size_t v = 0; v < kRowVectors; ++v) total[v] += value[point * kRowVectors + v];
      }
      const Lanes* side = rows + ((l - m) % 2 == 0 ? 0 : 6 * kRowVectors);
      for (size_t c = 0; c < 6; ++c) {
        Lanes sum = sums[index * 6 + c];
        for (size_t v = 0; v < kRowVectors; ++v) sum += side[c * kRowVectors + v] * total[v];
        sums[index * 6 + c] = sum;
      }
    }
  }
  double* out = &spectrum->coefficients[spectrum->offset(m, m)];
  for (size_t i = 0; i < sums.size(); ++i) {
    out[i] = (sums[i][0] + sums[i][1]) + (sums[i][2] + sums[i][3]);
  }
}

}  // namespace

int row_gauss_points(int height, std::span<const double> weights, double tolerance) {
  const double step = kPi / height;
  for (int points = 1;; ++points) {
    bool enough = true;
    for (size_t l = 0; l < weights.size() && enough; ++l) {
      const double error = gauss_phase_error(points, (static_cast<double>(l) + 1) * step);
      enough = error * std::abs(weights[l]) <= tolerance;
    }
    if (enough) return points;
  }
}

// The error of a map is the mean of its places' errors, weighted by their light: at most that of
// the worst place, the row at a pole. There, with x the distance times l and s = sqrt((2l + 1) / 4
// pi), the terms of m = 0 and m = 1 are s J_0(x) x and sqrt(2) s J_1(x) x; the first that n points
// over [0, H], H = (l + 1) pi / height, do not integrate are
//   x^(2n+1) / (4^n n!^2)  and  x^(2n) / (2^(2n-1) (n-1)! n!),
// and n points lose of x^(2n) H^(2n+1) r, r = n!^4 / ((2n+1) (2n)!^2), and (2n + 1) / 2 times as
// much, with H once more, of x^(2n+1). Relative to the row, H^2 / 2, and to L00 = 1 / sqrt(4 pi).
double row_band_error(int points, int l, int height) {
  const double n = points, phase = (l + 1) * kPi / height;
  const double log_rule = 4 * std::lgamma(n + 1) - std::log(2 * n + 1) - 2 * std::lgamma(2 * n + 1);
  const double log_power = log_rule + (2 * n - 1) * std::log(phase);
  const double odd =
      std::exp(log_power - (2 * n - 1) * std::log(2.0) - std::lgamma(n) - std::lgamma(n + 1)) *
      std::sqrt(2.0);
  const double even = std::exp(log_power - 2 * n * std::log(2.0) - 2 * std::lgamma(n + 1)) * phase *
                      (2 * n + 1) / 2;
  return 2 * std::sqrt(2.0 * l + 1) * (odd + even);
}

LatlongSpectrum project_latlong(const Image& image, int bands, int gauss_points, int threads,
                                Progress& progress) {
  assert(image.channels == 3 && bands >= 1 && gauss_points >= 1);
  const RowSpectra spectra = row_spectra(image, bands, threads, progress);
  const GaussRule rule = gauss_legendre(gauss_points);
  std::vector<BlockNodes> nodes;
  for (int block = 0; block < spectra.blocks; ++block) {
    nodes.push_back(block_nodes(block, image.height, rule));
  }
  const LegendreStart start(bands);
  LatlongSpectrum spectrum(bands);
  parallel_blocks(
      static_cast<size_t>(bands), 1, threads, progress,
      [&](size_t begin, size_t end) {
        for (size_t m = begin; m < end; ++m) {
          project_order(static_cast<int>(m), spectra, nodes, start, &spectrum);
        }
      },
      0.5, 1.0);
  return spectrum;
}

// The transform's axes are (world z, world x, world y), so f(d) = F(P d) with P d = (z, x, y): the
// world function is F turned by P^-1.
ShRgb world_harmonics(const LatlongSpectrum& spectrum, int bands) {
  assert(bands <= spectrum.bands);
  ShRgb turned(bands);
  for (int l = 0; l < bands; ++l) {
    for (int m = 0; m <= l; ++m) {
      const double* c = &spectrum.coefficients[spectrum.offset(l, m)];
      turned.coefficients[sh_index(l, m)] = {c[0], c[1], c[2]};
      if (m > 0) turned.coefficients[sh_index(l, -m)] = {c[3], c[4], c[5]};
    }
  }
  const double to_world[3][3] = {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}};
  return sh_rotate(turned, to_world);
}

LatlongSpectrum latlong_spectrum(const ShRgb& world) {
  const double from_world[3][3] = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}};
  const ShRgb turned = sh_rotate(world, from_world);
  LatlongSpectrum spectrum(world.bands);
  for (int l = 0; l < world.bands; ++l) {
    for (int m = 0; m <= l; ++m) {
      double* c = &spectrum.coefficients[spectrum.offset(l, m)];
      const Vec3d& cosine = turned.coefficients[sh_index(l, m)];
      const Vec3d sine = m > 0 ? turned.coefficients[sh_index(l, -m)] : Vec3d{};
      for (int channel = 0; channel < 3; ++channel) {
        c[channel] = cosine[channel];
        c[3 + channel] = sine[channel];
      }
    }
  }
  return spectrum;
}

std::vector<Vec3d> band_energy(const LatlongSpectrum& spectrum) {
  std::vector<Vec3d> energy(static_cast<size_t>(spectrum.bands));
  for (int m = 0; m < spectrum.bands; ++m) {
    for (int l = m; l < spectrum.bands; ++l) {
      const double* c = &spectrum.coefficients[spectrum.offset(l, m)];
      energy[static_cast<size_t>(l)] +=
          Vec3d{c[0] * c[0] + c[3] * c[3], c[1] * c[1] + c[4] * c[4], c[2] * c[2] + c[5] * c[5]};
    }
  }
  return energy;
}

}  // namespace lightkiln

// Sources: the separation of variables of every fast spherical harmonic transform (Reinecke,
// "Libpsht: algorithms for efficient spherical harmonic transforms", A&A 526, 2011, section 2),
// with texels as boxes instead of points.

#include "core/sphere/harmonic_transform.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/parallel.h"
#include "core/sphere/fourier.h"
#include "core/sphere/harmonic_rotation.h"
#include "core/sphere/legendre.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

namespace {

// Rows j and H-1-j mirror each other: P_lm(-z) = (-1)^(l+m) P_lm(z), so their sum meets the even
// l+m and their difference the odd ones, and one Legendre value serves both.
constexpr int kVectors = 4;                // of kLanes row pairs
constexpr int kPairs = kVectors * kLanes;  // row pairs in a block
constexpr size_t kBlock = 12 * kVectors;   // Lanes per (order, block): 6 sums, 6 differences

// Fourier integrals of all row pairs: for order m and block b, kBlock Lanes.
struct RowSpectra {
  int orders = 0, blocks = 0;
  std::vector<Lanes> values;
  Lanes* at(int m, int b) {
    return &values[(static_cast<size_t>(m) * static_cast<size_t>(blocks) + static_cast<size_t>(b)) *
                   kBlock];
  }
  const Lanes* at(int m, int b) const { return const_cast<RowSpectra*>(this)->at(m, b); }
};

// One vector of kLanes row pairs. Texel k is centred on longitude pi - D (k + 1/2), D = 2 pi / W,
// so
//   int f e^{i m phi} dphi = D sinc(m D / 2) e^{i m (pi - D/2)} sum_k f_k e^{-i m D k},
// and the sum is entry m mod W of the discrete transform. North and south rows travel as real and
// imaginary part of one complex signal Z: N_k = (Z_k + conj Z_{W-k}) / 2, S_k = (Z_k - conj
// Z_{W-k}) / 2i.
void transform_row_pairs(const Image& image, int first_pair, const Fourier& fourier, int vector,
                         int block, RowSpectra* spectra, std::vector<Complex4>& signal,
                         std::vector<Complex4>& work) {
  const int width = image.width, height = image.height, pairs = (height + 1) / 2;
  for (int channel = 0; channel < 3; ++channel) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const int north = first_pair + lane, south = height - 1 - north;
      const bool used = north < pairs;
      for (int k = 0; k < width; ++k) {
        Complex4& z = signal[static_cast<size_t>(k)];
        z.re[lane] = used ? double(image.at(k, north)[channel]) : 0.0;
        z.im[lane] = used && south > north ? double(image.at(k, south)[channel]) : 0.0;
      }
    }
    fourier.forward(signal.data(), work);
    for (int m = 0; m < spectra->orders; ++m) {
      const Complex4& a = signal[static_cast<size_t>(m % width)];
      const Complex4& b = signal[static_cast<size_t>((width - m % width) % width)];
      const Lanes n_re = 0.5 * (a.re + b.re), n_im = 0.5 * (a.im - b.im);
      const Lanes s_re = 0.5 * (a.im + b.im), s_im = 0.5 * (b.re - a.re);
      const double step = 2 * kPi / width, half = 0.5 * m * step;
      const double box = m == 0 ? step : step * std::sin(half) / half;
      const double re = box * std::cos(m * kPi - half), im = box * std::sin(m * kPi - half);
      Lanes* out = spectra->at(m, block) + vector;
      const auto place = [&](int slot, const Lanes& even_re, const Lanes& even_im) {
        out[(slot + channel) * kVectors] = even_re * re - even_im * im;
        out[(slot + 3 + channel) * kVectors] = even_re * im + even_im * re;
      };
      place(0, n_re + s_re, n_im + s_im);
      place(6, n_re - s_re, n_im - s_im);
    }
  }
}

// Gauss nodes of the rows of a block: z = cos theta and weight sin(theta) dtheta.
struct BlockNodes {
  std::vector<Lanes> cosine, sine, weight;  // [point * kVectors + vector]
  double farthest = 0;                      // largest polar distance of the block
};
BlockNodes block_nodes(int block, int height, const GaussRule& rule) {
  const size_t count = rule.nodes.size() * kVectors;
  BlockNodes nodes{std::vector<Lanes>(count), std::vector<Lanes>(count), std::vector<Lanes>(count),
                   0};
  const double step = kPi / height;
  for (size_t point = 0; point < rule.nodes.size(); ++point) {
    for (int i = 0; i < kPairs; ++i) {
      const int row = std::min(block * kPairs + i, (height + 1) / 2 - 1);
      const double theta = step * (row + 0.5 + 0.5 * rule.nodes[point]);
      const size_t slot = point * kVectors + static_cast<size_t>(i / kLanes);
      nodes.cosine[slot][i % kLanes] = std::cos(theta);
      nodes.sine[slot][i % kLanes] = std::sin(theta);
      nodes.weight[slot][i % kLanes] = 0.5 * step * rule.weights[point] * std::sin(theta);
      nodes.farthest = std::max(nodes.farthest, std::min(theta, kPi - theta));
    }
  }
  return nodes;
}

// All coefficients of order m: for each block of rows, the Legendre values of every band summed
// over the row's points meet the six sums or differences.
void project_order(int m, const RowSpectra& spectra, const std::vector<BlockNodes>& nodes,
                   const LegendreStart& start, LatlongSpectrum* spectrum) {
  const int bands = spectrum->bands;
  const LegendreStep step(m, bands);
  std::vector<Lanes> sums(static_cast<size_t>(bands - m) * 6, Lanes{});
  std::vector<Lanes> value, before;
  for (int block = 0; block < spectra.blocks; ++block) {
    const BlockNodes& at = nodes[static_cast<size_t>(block)];
    if (legendre_negligible(m, at.farthest, bands)) continue;
    const size_t count = at.cosine.size(), points = count / kVectors;
    value.assign(count, Lanes{});
    before.assign(count, Lanes{});
    for (size_t i = 0; i < count; ++i) {
      for (int lane = 0; lane < kLanes; ++lane) {
        value[i][lane] = at.weight[i][lane] * start(m, at.sine[i][lane]);
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
      Lanes total[kVectors] = {};
      for (size_t point = 0; point < points; ++point) {
        for (size_t v = 0; v < kVectors; ++v) total[v] += value[point * kVectors + v];
      }
      const Lanes* side = rows + ((l - m) % 2 == 0 ? 0 : 6 * kVectors);
      for (size_t c = 0; c < 6; ++c) {
        Lanes sum = sums[index * 6 + c];
        for (size_t v = 0; v < kVectors; ++v) sum += side[c * kVectors + v] * total[v];
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

LatlongSpectrum project_latlong(const Image& image, int bands, int gauss_points, int threads,
                                Progress& progress) {
  assert(image.channels == 3 && bands >= 1 && gauss_points >= 1);
  const int pairs = (image.height + 1) / 2;
  RowSpectra spectra;
  spectra.orders = bands;
  spectra.blocks = (pairs + kPairs - 1) / kPairs;
  spectra.values.resize(static_cast<size_t>(bands) * static_cast<size_t>(spectra.blocks) * kBlock);
  const Fourier fourier(image.width);
  const size_t vectors = static_cast<size_t>(spectra.blocks) * kVectors;
  parallel_blocks(
      vectors, 4, threads, progress,
      [&](size_t begin, size_t end) {
        std::vector<Complex4> signal(static_cast<size_t>(image.width)), work;
        for (size_t v = begin; v < end; ++v) {
          const int vector = static_cast<int>(v);
          transform_row_pairs(image, vector * kLanes, fourier, vector % kVectors, vector / kVectors,
                              &spectra, signal, work);
        }
      },
      0.0, 0.5);

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

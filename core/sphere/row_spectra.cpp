#include "core/sphere/row_spectra.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>

#include "core/base/instruction_sets.h"
#include "core/base/math.h"
#include "core/base/parallel.h"

namespace lightkiln {

namespace {

// Texel k is centred on longitude pi - D (k + 1/2), D = 2 pi / W, so
//   int f e^{i m phi} dphi = box sum_k f_k e^{i m phi_k},  box = D sinc(m D / 2).
double box_integral(int m, int width) {
  const double step = 2 * kPi / width, half = 0.5 * m * step;
  return m == 0 ? step : step * std::sin(half) / half;
}

// One vector of kLanes row pairs by fast transforms. With e^{i m phi_k} = e^{i m (pi - D/2)}
// e^{-i m D k} the sum is entry m mod W of the discrete transform. North and south rows travel as
// real and imaginary part of one complex signal Z: N_k = (Z_k + conj Z_{W-k}) / 2,
// S_k = (Z_k - conj Z_{W-k}) / 2i.
void transform_row_pairs(const Image& image, int vector_index, const Fourier& fourier,
                         RowSpectra* spectra, std::vector<Complex4>& signal,
                         std::vector<Complex4>& work) {
  const int width = image.width, height = image.height, pairs = (height + 1) / 2;
  const int first_pair = vector_index * kLanes;
  const int vector = vector_index % kRowVectors, block = vector_index / kRowVectors;
  for (int channel = 0; channel < 3; ++channel) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const int north = first_pair + lane, south = height - 1 - north;
      const bool used = north < pairs;
      for (int k = 0; k < width; ++k) {
        Complex4& z = signal[static_cast<size_t>(k)];
        z.re.set(lane, used ? double(image.at(k, north)[channel]) : 0.0);
        z.im.set(lane, used && south > north ? double(image.at(k, south)[channel]) : 0.0);
      }
    }
    fourier.forward(signal.data(), work);
    for (int m = 0; m < spectra->orders; ++m) {
      const Complex4& a = signal[static_cast<size_t>(m % width)];
      const Complex4& b = signal[static_cast<size_t>((width - m % width) % width)];
      const Lanes n_re = 0.5 * (a.re + b.re), n_im = 0.5 * (a.im - b.im);
      const Lanes s_re = 0.5 * (a.im + b.im), s_im = 0.5 * (b.re - a.re);
      const double box = box_integral(m, width), turn = m * (kPi - kPi / width);
      const double re = box * std::cos(turn), im = box * std::sin(turn);
      Lanes* out = spectra->at(m, block) + vector;
      const auto place = [&](int slot, const Lanes& even_re, const Lanes& even_im) {
        out[(slot + channel) * kRowVectors] = even_re * re - even_im * im;
        out[(slot + 3 + channel) * kRowVectors] = even_re * im + even_im * re;
      };
      place(0, n_re + s_re, n_im + s_im);
      place(6, n_re - s_re, n_im - s_im);
    }
  }
}

// box cos(m phi_k) and box sin(m phi_k) for the first quarter of a row, k < W / 4.
struct QuarterTable {
  int orders, quarter;
  std::vector<double> cosine, sine;  // [m * quarter + k]

  QuarterTable(int orders_, int width) : orders(orders_), quarter(width / 4) {
    for (int m = 0; m < orders; ++m) {
      const double box = box_integral(m, width);
      for (int k = 0; k < quarter; ++k) {
        const double phi = kPi - 2 * kPi * (k + 0.5) / width;
        cosine.push_back(box * std::cos(m * phi));
        sine.push_back(box * std::sin(m * phi));
      }
    }
  }
};

// R, G, B of a texel and, in the last lane, whatever follows it. The caller keeps 16 bytes
// readable.
void load_texel(const float* p, Lanes* texel) {
  typedef float Floats __attribute__((vector_size(16)));
  Floats values;
  std::memcpy(&values, p, sizeof values);
  texel->values = __builtin_convertvector(values, Lanes::Vector);
}

// Cosine and sine integrals of one row, R G B in the lanes: [2 m] and [2 m + 1].
//
// Texels k, W-1-k, W/2-1-k and W/2+k lie at phi, -phi, pi - phi and phi - pi. With values a, b, c,
// d
//   cos: cos(m phi) ((a + b) + s (c + d)),  sin: sin(m phi) ((a - b) - s (c - d)),  s = (-1)^m,
// so that a quarter of the products is left, on four folded signals. Tiles keep those in the cache.
LIGHTKILN_CLONES void sum_row(const float* row, int width, const QuarterTable& table,
                              std::vector<Lanes>& sums) {
  constexpr int kTile = 64;
  std::array<Lanes, kTile> folded[4];  // cosine even, cosine odd, sine even, sine odd m
  std::fill(sums.begin(), sums.end(), Lanes{});
  for (int first = 0; first < table.quarter; first += kTile) {
    const int count = std::min(kTile, table.quarter - first);
    for (int i = 0; i < count; ++i) {
      const int k = first + i;
      Lanes a, b, c, d;
      load_texel(row + 3 * k, &a);
      load_texel(row + 3 * (width - 1 - k), &b);
      load_texel(row + 3 * (width / 2 - 1 - k), &c);
      load_texel(row + 3 * (width / 2 + k), &d);
      const Lanes ab = a + b, cd = c + d, a_b = a - b, c_d = c - d;
      const size_t slot = static_cast<size_t>(i);
      folded[0][slot] = ab + cd;
      folded[1][slot] = ab - cd;
      folded[2][slot] = a_b - c_d;
      folded[3][slot] = a_b + c_d;
    }
    for (int m = 0; m < table.orders; ++m) {
      const size_t start =
          static_cast<size_t>(m) * static_cast<size_t>(table.quarter) + static_cast<size_t>(first);
      const double *cosine = &table.cosine[start], *sine = &table.sine[start];
      const Lanes *even = folded[m % 2].data(), *odd = folded[2 + m % 2].data();
      Lanes cosines{}, sines{};
      for (int i = 0; i < count; ++i) {
        cosines += even[i] * cosine[i];
        sines += odd[i] * sine[i];
      }
      sums[2 * static_cast<size_t>(m)] += cosines;
      sums[2 * static_cast<size_t>(m) + 1] += sines;
    }
  }
}

// One vector of kLanes row pairs by direct sums.
void sum_row_pairs(const Image& image, int vector_index, const QuarterTable& table,
                   RowSpectra* spectra) {
  const int height = image.height, pairs = (height + 1) / 2;
  const int vector = vector_index % kRowVectors, block = vector_index / kRowVectors;
  std::vector<Lanes> north_sums(2 * static_cast<size_t>(table.orders)), south_sums = north_sums;
  // The last texel of the image has nothing readable behind it: its row is copied.
  std::vector<float> last;
  const auto row = [&](int y) {
    const float* pixels = image.at(0, y);
    if (y < height - 1) return pixels;
    last.assign(pixels, pixels + 3 * image.width);
    last.push_back(0);
    return static_cast<const float*>(last.data());
  };
  for (int lane = 0; lane < kLanes; ++lane) {
    const int north = vector_index * kLanes + lane, south = height - 1 - north;
    if (north >= pairs) break;
    sum_row(row(north), image.width, table, north_sums);
    if (south > north) {
      sum_row(row(south), image.width, table, south_sums);
    } else {
      std::fill(south_sums.begin(), south_sums.end(), Lanes{});
    }
    for (int m = 0; m < table.orders; ++m) {
      Lanes* out = spectra->at(m, block) + vector;
      for (int part = 0; part < 2; ++part) {
        const Lanes& n = north_sums[static_cast<size_t>(2 * m + part)];
        const Lanes& s = south_sums[static_cast<size_t>(2 * m + part)];
        for (int channel = 0; channel < 3; ++channel) {
          out[(3 * part + channel) * kRowVectors].set(lane, n[channel] + s[channel]);
          out[(6 + 3 * part + channel) * kRowVectors].set(lane, n[channel] - s[channel]);
        }
      }
    }
  }
}

}  // namespace

// Measured at widths 1440, 1500, 2048 and 3000. Widths of other factors than 2, 3 and 5 take eleven
// times as long to transform.
int direct_row_orders(int width) {
  if (width % 4 != 0) return 0;
  return Fourier::transforms_directly(width) ? 26 : 320;
}

RowSpectra row_spectra(const Image& image, int orders, int threads, Progress& progress,
                       RowMethod method) {
  assert(image.channels == 3 && orders >= 1);
  assert(method != RowMethod::direct || image.width % 4 == 0);
  RowSpectra spectra;
  spectra.orders = orders;
  spectra.blocks = ((image.height + 1) / 2 + kRowPairs - 1) / kRowPairs;
  spectra.values.resize(static_cast<size_t>(orders) * static_cast<size_t>(spectra.blocks) *
                        kRowBlock);
  const size_t vectors = static_cast<size_t>(spectra.blocks) * kRowVectors;
  if (method == RowMethod::automatic) {
    method = orders <= direct_row_orders(image.width) ? RowMethod::direct : RowMethod::fourier;
  }
  if (method == RowMethod::direct) {
    const QuarterTable table(orders, image.width);
    const auto sum = [&](size_t begin, size_t end) {
      for (size_t v = begin; v < end; ++v) {
        sum_row_pairs(image, static_cast<int>(v), table, &spectra);
      }
    };
    parallel_blocks(vectors, 4, threads, progress, sum, 0.0, 0.5);
    return spectra;
  }
  const Fourier fourier(image.width);
  const auto transform = [&](size_t begin, size_t end) {
    std::vector<Complex4> signal(static_cast<size_t>(image.width)), work;
    for (size_t v = begin; v < end; ++v) {
      transform_row_pairs(image, static_cast<int>(v), fourier, &spectra, signal, work);
    }
  };
  parallel_blocks(vectors, 4, threads, progress, transform, 0.0, 0.5);
  return spectra;
}

}  // namespace lightkiln

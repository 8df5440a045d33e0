// The inverse transform onto rings, and interpolation between them.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>

#include "core/base/instruction_sets.h"
#include "core/base/parallel.h"
#include "core/sphere/fourier.h"
#include "core/sphere/harmonic_transform.h"
#include "core/sphere/legendre.h"

namespace lightkiln {

namespace {

constexpr int kMargin = RingGrid::kTaps;

// Weights of the polynomial through points -3 .. 4 at `t` in [0, 1]: the product over the other
// points of (t - j) / (i - j).
void lagrange_weights(double t, double weights[RingGrid::kTaps]) {
  constexpr int kFirst = 1 - RingGrid::kTaps / 2;
  // Reciprocals of prod_{j != i} (i - j) over eight consecutive integers.
  constexpr double kScale[RingGrid::kTaps] = {-1.0 / 5040, 1.0 / 720, -1.0 / 240, 1.0 / 144,
                                              -1.0 / 144,  1.0 / 240, -1.0 / 720, 1.0 / 5040};
  double prefix[RingGrid::kTaps + 1], suffix[RingGrid::kTaps + 1];
  prefix[0] = suffix[RingGrid::kTaps] = 1;
  for (int i = 0; i < RingGrid::kTaps; ++i) prefix[i + 1] = prefix[i] * (t - (kFirst + i));
  for (int i = RingGrid::kTaps; i > 0; --i) suffix[i - 1] = suffix[i] * (t - (kFirst + i - 1));
  for (int i = 0; i < RingGrid::kTaps; ++i) weights[i] = prefix[i] * suffix[i + 1] * kScale[i];
}

// |sum_j w_j e^{i phase j} - e^{i phase t}| halfway between two points, where it is largest.
double lagrange_phase_error(double phase) {
  double weights[RingGrid::kTaps];
  lagrange_weights(0.5, weights);
  std::complex<double> sum = -std::polar(1.0, 0.5 * phase);
  for (int i = 0; i < RingGrid::kTaps; ++i) {
    sum += weights[i] * std::polar(1.0, phase * (i + 1 - RingGrid::kTaps / 2));
  }
  return std::abs(sum);
}

typedef float Pixel4 __attribute__((vector_size(16)));

}  // namespace

RingGrid::RingGrid(int rings, int longitudes)
    : rings_(rings), longitudes_(longitudes), stride_(longitudes + 2 * kMargin) {
  assert(rings >= kMargin && longitudes >= kMargin && rings % 2 == 0 && longitudes % 2 == 0);
  pixels_.resize(static_cast<size_t>(rings + 2 * kMargin) * static_cast<size_t>(stride_) * 4);
}

void RingGrid::set(int ring, int longitude, const float rgb[3]) {
  const size_t row = static_cast<size_t>(ring + kMargin) * static_cast<size_t>(stride_);
  std::copy_n(rgb, 3, &pixels_[4 * (row + static_cast<size_t>(longitude + kMargin))]);
}

const float* RingGrid::at(int ring, int longitude) const {
  const size_t row = static_cast<size_t>(ring + kMargin) * static_cast<size_t>(stride_);
  return &pixels_[4 * (row + static_cast<size_t>(longitude + kMargin))];
}

Vec3d RingGrid::direction(int ring, int longitude) const {
  const double theta = kPi * (ring + 0.5) / rings_, phi = 2 * kPi * longitude / longitudes_;
  return {std::sin(theta) * std::sin(phi), std::cos(theta), std::sin(theta) * std::cos(phi)};
}

void RingGrid::close() {
  const size_t stride = 4 * static_cast<size_t>(stride_);
  const auto row = [&](int ring) { return &pixels_[static_cast<size_t>(ring + kMargin) * stride]; };
  const auto point = [](float* pixels, int k) { return pixels + 4 * (k + kMargin); };
  for (int ring = -kMargin; ring < rings_ + kMargin; ++ring) {
    const bool outside = ring < 0 || ring >= rings_;
    if (outside) {
      const int source = ring < 0 ? -1 - ring : 2 * rings_ - 1 - ring;
      for (int k = 0; k < longitudes_; ++k) {
        const int turned = (k + longitudes_ / 2) % longitudes_;
        std::copy_n(point(row(source), turned), 4, point(row(ring), k));
      }
    }
    for (int k = 1; k <= kMargin; ++k) {
      std::copy_n(point(row(ring), longitudes_ - k), 4, point(row(ring), -k));
      std::copy_n(point(row(ring), k - 1), 4, point(row(ring), longitudes_ + k - 1));
    }
  }
}

Vec3d RingGrid::interpolate(const Vec3d& direction) const {
  const double longitude = std::atan2(direction.x, direction.z);
  const double colatitude = std::atan2(std::hypot(direction.x, direction.z), direction.y);
  const double turns = longitude / (2 * kPi);
  const double x = (turns < 0 ? turns + 1 : turns) * longitudes_;
  const double y = colatitude / kPi * rings_ - 0.5;
  const double x0 = std::floor(x), y0 = std::floor(y);
  double wx[kTaps], wy[kTaps];
  lagrange_weights(x - x0, wx);
  lagrange_weights(y - y0, wy);
  const int column = static_cast<int>(x0) + 1 - kTaps / 2 + kMargin;
  const int ring = static_cast<int>(y0) + 1 - kTaps / 2 + kMargin;
  Pixel4 sum{};
  for (int j = 0; j < kTaps; ++j) {
    const size_t start =
        static_cast<size_t>(ring + j) * static_cast<size_t>(stride_) + static_cast<size_t>(column);
    const float* p = &pixels_[4 * start];
    Pixel4 line{};
    for (int i = 0; i < kTaps; ++i) {
      Pixel4 texel;
      __builtin_memcpy(&texel, p + 4 * i, sizeof texel);
      line += texel * static_cast<float>(wx[i]);
    }
    sum += line * static_cast<float>(wy[j]);
  }
  return {sum[0], sum[1], sum[2]};
}

double RingGrid::interpolation_error(int l, int rings, int longitudes) {
  return lagrange_phase_error(l * kPi / rings) + lagrange_phase_error(l * 2 * kPi / longitudes);
}

namespace {

// kLanes pairs of rings, north ring j and south ring rings-1-j.
struct RingPairs {
  Lanes cosine, sine;
  double farthest = 0;
};

// Sums over l of one order for kLanes ring pairs: even and odd l+m apart, six values each.
LIGHTKILN_CLONES void sum_order(const double* c, const LegendreStep& step, const Lanes& cosine,
                                const Lanes& start, int count, Lanes even[6], Lanes odd[6]) {
  Lanes before{}, value = start;
  for (int i = 0; i < count; ++i, c += 6) {
    if (i > 0) {
      const size_t index = static_cast<size_t>(i);
      const Lanes next = cosine * value * step.grow[index] - before * step.keep[index];
      before = value;
      value = next;
    }
    Lanes* side = i % 2 == 0 ? even : odd;
    for (int k = 0; k < 6; ++k) side[k] += value * c[k];
  }
}

// A real series sum A_m cos + B_m sin has X_m = (A - i B) / 2 and X_-m its conjugate; north and
// south rings travel as N + i S, as in the forward transform.
void place_order(int m, const Lanes even[6], const Lanes odd[6], int longitudes,
                 std::vector<Complex4> signals[3]) {
  for (int c = 0; c < 3; ++c) {
    const Lanes an = even[c] + odd[c], bn = even[c + 3] + odd[c + 3];
    const Lanes as = even[c] - odd[c], bs = even[c + 3] - odd[c + 3];
    std::vector<Complex4>& signal = signals[c];
    if (m == 0) {
      signal[0] = Complex4{an, as};
    } else {
      signal[static_cast<size_t>(m)] = Complex4{0.5 * (an + bs), 0.5 * (as - bn)};
      signal[static_cast<size_t>(longitudes - m)] = Complex4{0.5 * (an - bs), 0.5 * (as + bn)};
    }
  }
}

}  // namespace

RingGrid synthesise_rings(const LatlongSpectrum& spectrum, std::span<const double> factors,
                          int rings, int longitudes, int threads, Progress& progress) {
  const int bands = std::min(static_cast<int>(factors.size()), spectrum.bands);
  assert(bands >= 1 && longitudes >= 2 * bands);
  LatlongSpectrum scaled(bands);
  std::vector<LegendreStep> steps;
  for (int m = 0; m < bands; ++m) {
    steps.emplace_back(m, bands);
    for (int l = m; l < bands; ++l) {
      const double* c = &spectrum.coefficients[spectrum.offset(l, m)];
      double* out = &scaled.coefficients[scaled.offset(l, m)];
      for (int k = 0; k < 6; ++k) out[k] = c[k] * factors[static_cast<size_t>(l)];
    }
  }
  const LegendreStart start(bands);
  const Fourier fourier(longitudes);
  RingGrid grid(rings, longitudes);
  const int pairs = rings / 2;
  parallel_blocks(
      static_cast<size_t>((pairs + kLanes - 1) / kLanes), 1, threads, progress,
      [&](size_t begin, size_t end) {
        std::vector<Complex4> signals[3], work;
        for (size_t block = begin; block < end; ++block) {
          RingPairs at;
          const int first = static_cast<int>(block) * kLanes;
          for (int lane = 0; lane < kLanes; ++lane) {
            const double theta = kPi * (std::min(first + lane, pairs - 1) + 0.5) / rings;
            at.cosine.set(lane, std::cos(theta));
            at.sine.set(lane, std::sin(theta));
            at.farthest = std::max(at.farthest, theta);
          }
          for (auto& signal : signals) {
            signal.assign(static_cast<size_t>(longitudes), Complex4{Lanes{}, Lanes{}});
          }
          for (int m = 0; m < bands && !legendre_negligible(m, at.farthest, bands); ++m) {
            Lanes value{}, even[6] = {}, odd[6] = {};
            for (int lane = 0; lane < kLanes; ++lane) value.set(lane, start(m, at.sine[lane]));
            sum_order(&scaled.coefficients[scaled.offset(m, m)], steps[static_cast<size_t>(m)],
                      at.cosine, value, bands - m, even, odd);
            place_order(m, even, odd, longitudes, signals);
          }
          for (auto& signal : signals) fourier.inverse(signal.data(), work);
          for (int lane = 0; lane < kLanes && first + lane < pairs; ++lane) {
            for (size_t k = 0; k < static_cast<size_t>(longitudes); ++k) {
              float north[3], south[3];
              for (int c = 0; c < 3; ++c) {
                north[c] = static_cast<float>(signals[c][k].re[lane]);
                south[c] = static_cast<float>(signals[c][k].im[lane]);
              }
              grid.set(first + lane, static_cast<int>(k), north);
              grid.set(rings - 1 - first - lane, static_cast<int>(k), south);
            }
          }
        }
      });
  grid.close();
  return grid;
}

}  // namespace lightkiln

// Sources: Stockham's autosort form of the fast Fourier transform (Van Loan, "Computational
// Frameworks for the Fast Fourier Transform", 1992, sections 1.7 and 2.4); Bluestein, "A linear
// filtering approach to the computation of discrete Fourier transform", 1970.

#include "core/sphere/fourier.h"

#include <bit>
#include <cassert>
#include <cmath>
#include <utility>

#include "core/base/instruction_sets.h"
#include "core/base/math.h"

namespace lightkiln {

namespace {

Complex4 operator+(const Complex4& a, const Complex4& b) {
  return {a.re + b.re, a.im + b.im};
}
Complex4 operator-(const Complex4& a, const Complex4& b) {
  return {a.re - b.re, a.im - b.im};
}
Complex4 times(const Complex4& a, double re, double im) {
  return {a.re * re - a.im * im, a.re * im + a.im * re};
}

void swap_parts(Complex4* data, int count) {
  for (int i = 0; i < count; ++i) std::swap(data[i].re, data[i].im);
}

// Each pass of length n and stride s combines four runs n/4 apart and writes them in order, so that
// no bit reversal is needed; a last pass of radix 2 completes odd powers.
LIGHTKILN_CLONES void run_passes(Complex4* data, Complex4* work, int length, const double* cosine,
                                 const double* sine) {
  Complex4 *x = data, *y = work;
  int n = length, s = 1;
  for (; n >= 4; n /= 4, s *= 4) {
    const int m = n / 4;
    for (int p = 0; p < m; ++p) {
      const size_t w1 = static_cast<size_t>(p) * static_cast<size_t>(s), w2 = 2 * w1, w3 = 3 * w1;
      for (int q = 0; q < s; ++q) {
        const Complex4 a = x[q + s * p], b = x[q + s * (p + m)];
        const Complex4 c = x[q + s * (p + 2 * m)], d = x[q + s * (p + 3 * m)];
        const Complex4 ac = a + c, a_c = a - c, bd = b + d;
        const Complex4 jbd{d.im - b.im, b.re - d.re};  // i (b - d)
        y[q + s * (4 * p)] = ac + bd;
        y[q + s * (4 * p + 1)] = times(a_c - jbd, cosine[w1], -sine[w1]);
        y[q + s * (4 * p + 2)] = times(ac - bd, cosine[w2], -sine[w2]);
        y[q + s * (4 * p + 3)] = times(a_c + jbd, cosine[w3], -sine[w3]);
      }
    }
    std::swap(x, y);
  }
  if (n == 2) {
    for (int q = 0; q < s; ++q) {
      const Complex4 a = x[q], b = x[q + s];
      y[q] = a + b;
      y[q + s] = a - b;
    }
    std::swap(x, y);
  }
  if (x != data) {
    for (int i = 0; i < length; ++i) data[i] = x[i];
  }
}

}  // namespace

Fourier::Fourier(int length) : length_(length), padded_(length) {
  assert(length >= 1);
  const bool direct = std::has_single_bit(static_cast<unsigned>(length));
  if (!direct) padded_ = static_cast<int>(std::bit_ceil(static_cast<unsigned>(2 * length - 1)));
  for (int j = 0; j < padded_; ++j) {
    cosine_.push_back(std::cos(2 * kPi * j / padded_));
    sine_.push_back(std::sin(2 * kPi * j / padded_));
  }
  if (direct) return;
  // j k = (j^2 + k^2 - (k - j)^2) / 2 turns the transform into a convolution with the conjugate
  // chirp. j^2 is reduced modulo 2 n before it becomes an angle.
  std::vector<Complex4> filter(static_cast<size_t>(padded_)), work(filter.size());
  for (int j = 0; j < length; ++j) {
    const long long square = static_cast<long long>(j) * j % (2LL * length);
    const double angle = kPi * static_cast<double>(square) / length;
    chirp_re_.push_back(std::cos(angle));
    chirp_im_.push_back(-std::sin(angle));
    const Complex4 conjugate{{std::cos(angle), 0, 0, 0}, {std::sin(angle), 0, 0, 0}};
    filter[static_cast<size_t>(j)] = conjugate;
    if (j > 0) filter[static_cast<size_t>(padded_ - j)] = conjugate;
  }
  power_of_two(filter.data(), work.data());
  for (const Complex4& value : filter) {
    filter_re_.push_back(value.re[0] / padded_);
    filter_im_.push_back(value.im[0] / padded_);
  }
}

void Fourier::power_of_two(Complex4* data, Complex4* work) const {
  run_passes(data, work, padded_, cosine_.data(), sine_.data());
}

void Fourier::forward(Complex4* data, std::vector<Complex4>& work) const {
  const size_t padded = static_cast<size_t>(padded_), length = static_cast<size_t>(length_);
  if (chirp_re_.empty()) {
    if (work.size() < padded) work.resize(padded);
    power_of_two(data, work.data());
    return;
  }
  if (work.size() < 2 * padded) work.resize(2 * padded);
  Complex4* signal = work.data();
  for (size_t j = 0; j < length; ++j) signal[j] = times(data[j], chirp_re_[j], chirp_im_[j]);
  for (size_t j = length; j < padded; ++j) signal[j] = Complex4{Lanes{}, Lanes{}};
  power_of_two(signal, signal + padded);
  for (size_t j = 0; j < padded; ++j) signal[j] = times(signal[j], filter_re_[j], filter_im_[j]);
  swap_parts(signal, padded_);
  power_of_two(signal, signal + padded);
  swap_parts(signal, padded_);
  for (size_t j = 0; j < length; ++j) data[j] = times(signal[j], chirp_re_[j], chirp_im_[j]);
}

// Exchanging real and imaginary parts before and after conjugates the kernel.
void Fourier::inverse(Complex4* data, std::vector<Complex4>& work) const {
  swap_parts(data, length_);
  forward(data, work);
  swap_parts(data, length_);
}

}  // namespace lightkiln

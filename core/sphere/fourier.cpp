// Sources: Stockham's autosort form of the fast Fourier transform (Van Loan, "Computational
// Frameworks for the Fast Fourier Transform", 1992, sections 1.7 and 2.4); Bluestein, "A linear
// filtering approach to the computation of discrete Fourier transform", 1970.

#include "core/sphere/fourier.h"

#include <algorithm>
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

Complex4 scaled(const Complex4& a, double by) {
  return {a.re * by, a.im * by};
}
Complex4 turned(const Complex4& a, double by) {  // times i
  return {a.im * -by, a.re * by};
}

void swap_parts(Complex4* data, int count) {
  for (int i = 0; i < count; ++i) std::swap(data[i].re, data[i].im);
}

// One step of a transform of signals of length n, s of them side by side.
struct Pass {
  const Complex4* from;
  Complex4* to;
  int n, s;
  const double *cosine, *sine;  // of 2 pi j / (n s)
};

// Writes output j of the butterfly of place p and signal q, turned by exp(-2 pi i p j / n).
[[gnu::always_inline]] inline void put(const Pass& pass, int radix, int p, int q, int j,
                                       const Complex4& value) {
  const size_t turn = static_cast<size_t>(p) * static_cast<size_t>(j) * static_cast<size_t>(pass.s);
  pass.to[q + pass.s * (radix * p + j)] = times(value, pass.cosine[turn], -pass.sine[turn]);
}

[[gnu::always_inline]] inline void run_pass_2(const Pass& pass) {
  const int m = pass.n / 2, s = pass.s;
  for (int p = 0; p < m; ++p) {
    for (int q = 0; q < s; ++q) {
      const Complex4 a = pass.from[q + s * p], b = pass.from[q + s * (p + m)];
      pass.to[q + s * (2 * p)] = a + b;
      put(pass, 2, p, q, 1, a - b);
    }
  }
}

// The cube roots of one are 1 and -1/2 -+ i sqrt(3/4).
[[gnu::always_inline]] inline void run_pass_3(const Pass& pass) {
  const int m = pass.n / 3, s = pass.s;
  const double root = std::sqrt(0.75);
  for (int p = 0; p < m; ++p) {
    for (int q = 0; q < s; ++q) {
      const Complex4 a = pass.from[q + s * p], b = pass.from[q + s * (p + m)];
      const Complex4 c = pass.from[q + s * (p + 2 * m)];
      const Complex4 both = b + c, middle = a - scaled(both, 0.5);
      const Complex4 side = turned(b - c, root);
      pass.to[q + s * (3 * p)] = a + both;
      put(pass, 3, p, q, 1, middle - side);
      put(pass, 3, p, q, 2, middle + side);
    }
  }
}

[[gnu::always_inline]] inline void run_pass_4(const Pass& pass) {
  const int m = pass.n / 4, s = pass.s;
  for (int p = 0; p < m; ++p) {
    for (int q = 0; q < s; ++q) {
      const Complex4 a = pass.from[q + s * p], b = pass.from[q + s * (p + m)];
      const Complex4 c = pass.from[q + s * (p + 2 * m)], d = pass.from[q + s * (p + 3 * m)];
      const Complex4 ac = a + c, a_c = a - c, bd = b + d;
      const Complex4 jbd{d.im - b.im, b.re - d.re};  // i (b - d)
      pass.to[q + s * (4 * p)] = ac + bd;
      put(pass, 4, p, q, 1, a_c - jbd);
      put(pass, 4, p, q, 2, ac - bd);
      put(pass, 4, p, q, 3, a_c + jbd);
    }
  }
}

// With c_k = cos(2 pi k / 5) and s_k = sin(2 pi k / 5), outputs 1 and 4 are
//   a + c_1 (b + e) + c_2 (c + d) -+ i (s_1 (b - e) + s_2 (c - d)),
// outputs 2 and 3 the same with c_2, c_1, s_2 and -s_1.
[[gnu::always_inline]] inline void run_pass_5(const Pass& pass) {
  const int m = pass.n / 5, s = pass.s;
  const double c1 = std::cos(0.4 * kPi), c2 = std::cos(0.8 * kPi);
  const double s1 = std::sin(0.4 * kPi), s2 = std::sin(0.8 * kPi);
  for (int p = 0; p < m; ++p) {
    for (int q = 0; q < s; ++q) {
      const Complex4 a = pass.from[q + s * p], b = pass.from[q + s * (p + m)];
      const Complex4 c = pass.from[q + s * (p + 2 * m)], d = pass.from[q + s * (p + 3 * m)];
      const Complex4 e = pass.from[q + s * (p + 4 * m)];
      const Complex4 be = b + e, cd = c + d, b_e = b - e, c_d = c - d;
      const Complex4 outer = a + scaled(be, c1) + scaled(cd, c2);
      const Complex4 inner = a + scaled(be, c2) + scaled(cd, c1);
      const Complex4 outer_side = turned(b_e, s1) + turned(c_d, s2);
      const Complex4 inner_side = turned(b_e, s2) - turned(c_d, s1);
      pass.to[q + s * (5 * p)] = a + be + cd;
      put(pass, 5, p, q, 1, outer - outer_side);
      put(pass, 5, p, q, 2, inner - inner_side);
      put(pass, 5, p, q, 3, inner + inner_side);
      put(pass, 5, p, q, 4, outer + outer_side);
    }
  }
}

// Each pass of length n and stride s combines `radix` runs n / radix apart and writes them in
// order, so that nothing has to be sorted afterwards.
LIGHTKILN_CLONES void run_passes(Complex4* data, Complex4* work, int length, const double* cosine,
                                 const double* sine) {
  Complex4 *x = data, *y = work;
  int s = 1;
  for (int n = length; n > 1;) {
    const Pass pass{x, y, n, s, cosine, sine};
    int radix = 4;
    if (n % 4 == 0) {
      run_pass_4(pass);
    } else if (n % 2 == 0) {
      radix = 2;
      run_pass_2(pass);
    } else if (n % 3 == 0) {
      radix = 3;
      run_pass_3(pass);
    } else {
      radix = 5;
      run_pass_5(pass);
    }
    n /= radix;
    s *= radix;
    std::swap(x, y);
  }
  if (x != data) std::copy_n(x, length, data);
}

}  // namespace

bool Fourier::transforms_directly(int length) {
  for (const int radix : {2, 3, 5}) {
    while (length % radix == 0) length /= radix;
  }
  return length == 1;
}

Fourier::Fourier(int length) : length_(length), padded_(length) {
  assert(length >= 1);
  const bool direct = transforms_directly(length);
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
  transform(filter.data(), work.data());
  for (const Complex4& value : filter) {
    filter_re_.push_back(value.re[0] / padded_);
    filter_im_.push_back(value.im[0] / padded_);
  }
}

void Fourier::transform(Complex4* data, Complex4* work) const {
  run_passes(data, work, padded_, cosine_.data(), sine_.data());
}

void Fourier::forward(Complex4* data, std::vector<Complex4>& work) const {
  const size_t padded = static_cast<size_t>(padded_), length = static_cast<size_t>(length_);
  if (chirp_re_.empty()) {
    if (work.size() < padded) work.resize(padded);
    transform(data, work.data());
    return;
  }
  if (work.size() < 2 * padded) work.resize(2 * padded);
  Complex4* signal = work.data();
  for (size_t j = 0; j < length; ++j) signal[j] = times(data[j], chirp_re_[j], chirp_im_[j]);
  for (size_t j = length; j < padded; ++j) signal[j] = Complex4{Lanes{}, Lanes{}};
  transform(signal, signal + padded);
  for (size_t j = 0; j < padded; ++j) signal[j] = times(signal[j], filter_re_[j], filter_im_[j]);
  swap_parts(signal, padded_);
  transform(signal, signal + padded);
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

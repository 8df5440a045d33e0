#pragma once

// Discrete Fourier transforms of any length, four signals at a time.

#include <cstddef>
#include <vector>

#include "core/base/lanes.h"

namespace lightkiln {

// Four complex numbers, one of each signal.
struct Complex4 {
  Lanes re, im;
};

// X_k = sum_j x_j exp(-2 pi i j k / n), for four signals. Powers of two in n log n by radix 4;
// other lengths as a convolution of the next power of two above 2 n.
class Fourier {
 public:
  explicit Fourier(int length);

  int length() const { return length_; }
  // Transforms data[0, length) in place; `work` is grown as needed and may be reused.
  void forward(Complex4* data, std::vector<Complex4>& work) const;
  // The unscaled inverse: x_j = sum_k X_k exp(+2 pi i j k / n).
  void inverse(Complex4* data, std::vector<Complex4>& work) const;

 private:
  int length_;
  int padded_;                  // the power of two that is actually transformed
  std::vector<double> cosine_;  // of 2 pi j / padded
  std::vector<double> sine_;
  std::vector<double> chirp_re_, chirp_im_;    // exp(-i pi j^2 / length), empty for powers of two
  std::vector<double> filter_re_, filter_im_;  // its transform, scaled by 1 / padded

  void power_of_two(Complex4* data, Complex4* work) const;
};

}  // namespace lightkiln

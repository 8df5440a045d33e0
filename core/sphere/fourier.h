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

// X_k = sum_j x_j exp(-2 pi i j k / n), for four signals. Products of 2, 3 and 5 by passes of
// those and of 4; other lengths as a convolution of the next power of two above 2 n.
class Fourier {
 public:
  explicit Fourier(int length);

  int length() const { return length_; }
  // Whether that is a product of 2, 3 and 5: others take about eleven times as long.
  static bool transforms_directly(int length);
  // Transforms data[0, length) in place; `work` is grown as needed and may be reused.
  void forward(Complex4* data, std::vector<Complex4>& work) const;
  // The unscaled inverse: x_j = sum_k X_k exp(+2 pi i j k / n).
  void inverse(Complex4* data, std::vector<Complex4>& work) const;

 private:
  int length_;
  int padded_;                  // the length that is actually transformed
  std::vector<double> cosine_;  // of 2 pi j / padded
  std::vector<double> sine_;
  // exp(-i pi j^2 / length); none where the length is transformed as it is.
  std::vector<double> chirp_re_, chirp_im_;
  std::vector<double> filter_re_, filter_im_;  // its transform, scaled by 1 / padded

  void transform(Complex4* data, Complex4* work) const;
};

}  // namespace lightkiln

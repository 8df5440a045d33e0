// Sources: Holmes & Featherstone 2002 (see harmonics.cpp); Abramowitz & Stegun, "Handbook of
// Mathematical Functions", 9.3.2 (Debye's expansion of J_m below the turning point).

#include "core/sphere/legendre.h"

#include <cmath>

#include "core/base/math.h"

namespace lightkiln {

LegendreStep::LegendreStep(int m, int bands) : grow(1, 0.0), keep(1, 0.0) {
  for (int l = m + 1; l < bands; ++l) {
    const double l2 = double(l) * l, m2 = double(m) * m, k2 = double(l - 1) * (l - 1);
    const double a = std::sqrt((4 * l2 - 1) / (l2 - m2));
    const double b = l > m + 1 ? std::sqrt((k2 - m2) / (4 * k2 - 1)) : 0.0;
    grow.push_back(a);
    keep.push_back(a * b);
  }
}

LegendreStart::LegendreStart(int bands) {
  double scale = std::sqrt(1 / (4 * kPi));
  for (int m = 0; m < bands; ++m) {
    if (m > 0) scale *= std::sqrt((2.0 * m + 1) / (2.0 * m));
    scale_.push_back(m > 0 ? std::sqrt(2.0) * scale : scale);
  }
}

double LegendreStart::operator()(int m, double sine) const {
  return scale_[static_cast<size_t>(m)] * std::pow(sine, m);
}

bool legendre_negligible(int m, double theta, int bands) {
  const double argument = bands * theta;
  if (m <= argument) return false;
  const double a = std::acosh(m / argument);
  return m * (std::tanh(a) - a) < -35;
}

}  // namespace lightkiln

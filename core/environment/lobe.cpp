#include "core/environment/lobe.h"

#include <algorithm>
#include <cmath>

#include "core/base/math.h"
#include "core/environment/charlie_lobe.h"
#include "core/environment/ggx_lobe.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

std::unique_ptr<ZonalKernel> make_kernel(const Lobe& lobe) {
  if (lobe.kind == LobeKind::charlie) {
    return std::make_unique<CharlieLobe>(lobe.alpha);
  }
  return std::make_unique<GgxLobe>(lobe.alpha);
}

// h_l = 2 pi integral_0^{pi/2} kernel(t) P_l(cos t) sin t dt by panels of 16 Gauss points, none
// wider than the kernel allows nor than 24 radians of the fastest band. Eight points at a time walk
// up the bands together.
std::vector<double> band_responses(const ZonalKernel& kernel, int bands) {
  constexpr size_t kPoints = 16, kTogether = 8;
  const GaussRule rule = gauss_legendre(kPoints);
  std::vector<double> responses(static_cast<size_t>(bands));
  std::vector<double> grow, keep;
  for (int l = 0; l < bands; ++l) {
    grow.push_back(l > 0 ? (2.0 * l - 1) / l : 0.0);
    keep.push_back(l > 0 ? (l - 1.0) / l : 0.0);
  }
  for (double begin = 0; begin < kPi / 2;) {
    const double end = std::min(kPi / 2, begin + std::min(kernel.panel(begin), 24.0 / bands));
    for (size_t first = 0; first < kPoints; first += kTogether) {
      double z[kTogether], before[kTogether] = {}, value[kTogether];
      double sum = 0;
      for (size_t i = 0; i < kTogether; ++i) {
        const double angle = begin + (end - begin) * 0.5 * (1 + rule.nodes[first + i]);
        z[i] = std::cos(angle);
        value[i] = kPi * kernel.at_angle(angle) * std::sin(angle) * (end - begin) *
                   rule.weights[first + i];
        sum += value[i];
      }
      responses[0] += sum;
      for (size_t l = 1; l < responses.size(); ++l) {
        sum = 0;
        for (size_t i = 0; i < kTogether; ++i) {
          const double next = grow[l] * z[i] * value[i] - keep[l] * before[i];
          before[i] = value[i];
          value[i] = next;
          sum += next;
        }
        responses[l] += sum;
      }
    }
    begin = end;
  }
  return responses;
}

}  // namespace lightkiln

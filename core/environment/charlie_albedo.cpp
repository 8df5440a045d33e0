// Sources: Estevez & Kulla, "Production Friendly Microfacet Sheen BRDF", SIGGRAPH 2017 course (the
// distribution); Neubelt & Pettineo, "Crafting a Next-Gen Material Pipeline for The Order: 1886",
// SIGGRAPH 2013 course (the visibility); Filament, libs/ibl/src/CubemapIBL.cpp (their product's
// integral as the third channel of its table).

#include "core/environment/charlie_albedo.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "core/base/instruction_sets.h"
#include "core/base/math.h"
#include "core/environment/vector_math.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

namespace {

constexpr int kPoints = 24;

// Directions l by cosine and azimuth from v's own, gathered where the integrand bends: towards the
// horizon and the normal, and opposite v, where both cancel out of the half vector.
struct Rule {
  std::vector<double> cosine, weight;
  std::vector<double> opening, azimuth_weight;  // opening = 1 + cos(azimuth)
};

Rule make_rule(int points) {
  const GaussRule gauss = gauss_legendre(points);
  Rule rule;
  for (size_t i = 0; i < gauss.nodes.size(); ++i) {
    const double t = 0.5 * (1 + gauss.nodes[i]), weight = 0.5 * gauss.weights[i];
    rule.cosine.push_back(t * t * t * (4 - 3 * t));
    rule.weight.push_back(weight * 12 * t * t * (1 - t));
    const double s = std::sin(0.5 * kPi * t * t * t);
    rule.opening.push_back(2 * s * s);
    rule.azimuth_weight.push_back(weight * kPi * 3 * t * t);
  }
  return rule;
}

// The sum over azimuths of (1 - h.z^2)^power, where h.z^2 = d2 / (2 (base + ring opening)).
LIGHTKILN_CLONES double sum_azimuths(const double* opening, const double* weight, size_t count,
                                     double d2, double base, double ring, double power,
                                     double* terms) {
  for (size_t j = 0; j < count; ++j) {
    const double h2 = d2 / (2 * (base + ring * opening[j]));
    terms[j] = weight[j] * power_below_one(h2 < 1 ? 1 - h2 : 0.0, power);
  }
  double sum = 0;
  for (size_t j = 0; j < count; ++j) sum += terms[j];
  return sum;
}

}  // namespace

// D = (2 + 1/a) sin(h)^(1/a) / (2 pi), and with h along v + l
//   cos(h)^2 = (v.z + l.z)^2 / (2 (1 + v.l)),  v.l = v.z l.z + s_v s_l cos(azimuth),
//   1 + v.l = (1 + v.z l.z - s_v s_l) + s_v s_l (1 + cos(azimuth)).
// At its largest, azimuth 0, sin(h)^(1/a) is already next to nothing for most of the table's low
// roughness: those cosines are skipped.
double charlie_albedo(double alpha, double cosine, int refinement) {
  assert(alpha > 0 && alpha <= 1 && cosine > 0 && cosine <= 1 && refinement >= 1);
  static const Rule coarse = make_rule(kPoints), fine = make_rule(2 * kPoints);
  const Rule refined = refinement > 1 ? make_rule(refinement * kPoints) : Rule{};
  const Rule& rule = refinement > 1 ? refined : (alpha < 1e-3 ? fine : coarse);
  const double power = 0.5 / alpha, sine = std::sqrt((1 - cosine) * (1 + cosine));
  std::vector<double> terms(rule.opening.size());
  double sum = 0;
  for (size_t i = 0; i < rule.cosine.size(); ++i) {
    const double c = rule.cosine[i], ring = sine * std::sqrt((1 - c) * (1 + c));
    const double d2 = (cosine + c) * (cosine + c), base = 1 + cosine * c - ring;
    if (power * d2 / (2 * (base + 2 * ring)) > 40) continue;
    sum += rule.weight[i] * c / (4 * (c + cosine - c * cosine)) *
           sum_azimuths(rule.opening.data(), rule.azimuth_weight.data(), terms.size(), d2, base,
                        ring, power, terms.data());
  }
  return sum * 2 * (2 + 1 / alpha) / (2 * kPi);
}

}  // namespace lightkiln

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

std::span<const CharlieRule> charlie_rules() {
  static const CharlieRule rules[] = {{8, 4e-2},    {9, 1.4e-2},  {10, 5e-3},   {12, 9e-4},
                                      {14, 2e-4},   {16, 7e-5},   {20, 1.5e-5}, {24, 5e-6},
                                      {32, 2.4e-6}, {40, 1.2e-6}, {56, 5e-7}};
  return rules;
}

const CharlieRule& charlie_rule(double error) {
  for (const CharlieRule& rule : charlie_rules()) {
    if (rule.error_bound <= error) return rule;
  }
  return charlie_rules().back();
}

// Directions l by cosine and azimuth from v's own, gathered where the integrand bends: towards the
// horizon and the normal, and opposite v, where both cancel out of the half vector.
CharlieIntegral::CharlieIntegral(int points) {
  const GaussRule gauss = gauss_legendre(points);
  for (size_t i = 0; i < gauss.nodes.size(); ++i) {
    const double t = 0.5 * (1 + gauss.nodes[i]), weight = 0.5 * gauss.weights[i];
    cosine_.push_back(t * t * t * (4 - 3 * t));
    weight_.push_back(weight * 12 * t * t * (1 - t));
    const double s = std::sin(0.5 * kPi * t * t * t);
    opening_.push_back(2 * s * s);
    azimuth_weight_.push_back(weight * kPi * 3 * t * t);
  }
}

namespace {

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
// At its largest, azimuth 0, 1 + v.l is at most 2, so that sin(h)^(1/a) = (1 - cos(h)^2)^(1/(2a))
// is under exp(-(v.z + l.z)^2 / (8 a)): past exponent 30 nothing is left, and the cosines are
// gathered below that reach. Their panel then shrinks with the lobe, and the error does not grow as
// it does.
double CharlieIntegral::at(double alpha, double cosine) const {
  assert(alpha > 0 && alpha <= 1 && cosine > 0 && cosine <= 1);
  constexpr double kExponent = 30;
  const double reach = std::min(1.0, std::sqrt(8 * kExponent * alpha) - cosine);
  if (reach <= 0) return 0;
  const double power = 0.5 / alpha, sine = std::sqrt((1 - cosine) * (1 + cosine));
  std::vector<double> terms(opening_.size());
  double sum = 0;
  for (size_t i = 0; i < cosine_.size(); ++i) {
    const double c = reach * cosine_[i], ring = sine * std::sqrt((1 - c) * (1 + c));
    const double d2 = (cosine + c) * (cosine + c), base = 1 + cosine * c - ring;
    sum += weight_[i] * c / (4 * (c + cosine - c * cosine)) *
           sum_azimuths(opening_.data(), azimuth_weight_.data(), terms.size(), d2, base, ring,
                        power, terms.data());
  }
  return sum * reach * 2 * (2 + 1 / alpha) / (2 * kPi);
}

double charlie_albedo(double alpha, double cosine, int refinement) {
  constexpr int kPoints = 20;
  static const CharlieIntegral usual(kPoints);
  if (refinement == 1) return usual.at(alpha, cosine);
  return CharlieIntegral(refinement * kPoints).at(alpha, cosine);
}

}  // namespace lightkiln

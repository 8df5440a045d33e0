// Sources: Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 course (split sum); Heitz,
// "Understanding the Masking-Shadowing Function", JCGT 3(2), 2014 (height-correlated Smith), and
// "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018 (the stretched hemisphere);
// Turquin, "Practical multiple scattering compensation for microfacet models", 2019 (compensation
// by 1 / E); Filament, libs/ibl/src/CubemapIBL.cpp, DFV_Multiscatter (the layout that serves it).

#include "core/environment/dfg.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <vector>

#include "core/base/instruction_sets.h"
#include "core/base/parallel.h"
#include "core/environment/charlie_albedo.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

std::span<const DfgRule> dfg_rules() {
  static const DfgRule rules[] = {{3, 5, 7e-3},   {4, 8, 1.5e-3},   {5, 10, 4e-4},   {6, 15, 9e-5},
                                  {8, 16, 3e-5},  {10, 20, 9e-6},   {10, 25, 4e-6},  {12, 30, 2e-6},
                                  {16, 40, 7e-7}, {20, 50, 2.7e-7}, {24, 60, 1.2e-7}};
  return rules;
}

const DfgRule& dfg_rule(double error) {
  for (const DfgRule& rule : dfg_rules()) {
    if (rule.error_bound <= error) return rule;
  }
  return dfg_rules().back();
}

// Gauss points, gathered quadratically where the integrand bends: at azimuth pi/2 and at the rim.
DfgIntegral::DfgIntegral(int azimuths, int radii) {
  assert(azimuths >= 1 && radii >= 1 && radii <= kMostDfgRadii);
  const GaussRule a = gauss_legendre(azimuths), r = gauss_legendre(radii);
  for (const int side : {-1, 1}) {
    for (size_t i = 0; i < a.nodes.size(); ++i) {
      const double s = 0.5 * (1 + a.nodes[i]);
      const double phi = kPi / 2 * (1 + side * s * s);
      nodes_.azimuths.push_back({std::cos(phi), std::sin(phi), 0.5 * s * a.weights[i]});
    }
  }
  for (size_t i = 0; i < r.nodes.size(); ++i) {
    const double s = 0.5 * (1 - r.nodes[i]);
    nodes_.radii.push_back(1 - s * s);
    nodes_.weights.push_back(s * r.weights[i]);
  }
}

namespace {

// In the space stretched by 1/alpha, GGX normals are a unit hemisphere: h ~ (a d.x, a d.y, d.z),
// and those visible from v = (s, 0, c) have the density (w.d) / (pi (1 + w.z) / 2) over the
// hemisphere of d, w being the unit vector along (a s, 0, c). The reflected share is the mean of
//   G2 / G1 = (1 + L(v)) / (1 + L(v) + L(l)),  L(x) = (sqrt(a^2 + (1 - a^2) x.z^2) / x.z - 1) / 2,
// over those d whose reflection l = 2 (v.h) h - v lies above the horizon. In slopes (x, y) = (h.x,
// h.y) / h.z that is 2 (s x + c) > c (1 + x^2 + y^2), the disc of radius 1/c about (s/c, 0); seen
// from the origin its rim at azimuth phi is T cos phi + sqrt(T^2 cos^2 phi + 1), T = s/c. Polar
// coordinates about the origin with k = tan(angle of d / 2) need no trigonometric function:
//   d = (2k cos phi, 2k sin phi, 1 - k^2) / (1 + k^2),  dw = (2k / (1 + k^2)) (2 dk / (1 + k^2))
//   dphi.
// Radii stand side by side for vector code, which gives the same bits at any width.
LIGHTKILN_CLONES DfgValue integrate(double alpha, double cosine, const DfgNodes& rule) {
  const double a2 = alpha * alpha, sine = std::sqrt((1 - cosine) * (1 + cosine));
  const double norm = 1 / std::sqrt(a2 * sine * sine + cosine * cosine);
  const double w_x = alpha * sine * norm, w_z = cosine * norm;
  const auto smith = [&](double z) { return std::sqrt(a2 + (1 - a2) * z * z); };
  const double open = 0.5 * (smith(cosine) / cosine + 1);  // 1 + L(v)
  const size_t radii = rule.radii.size();
  const double *places = rule.radii.data(), *weights = rule.weights.data();
  std::array<double, kMostDfgRadii> scales, biases;
  DfgValue sum;
  for (const DfgNodes::Azimuth& azimuth : rule.azimuths) {
    const double reach = sine / cosine * azimuth.cosine, root = std::sqrt(reach * reach + 1);
    const double rim = (reach > 0 ? reach + root : 1 / (root - reach)) / alpha;
    const double limit = rim / (1 + std::sqrt(1 + rim * rim));
    for (size_t i = 0; i < radii; ++i) {
      const double k = limit * places[i], inverse = 1 / (1 + k * k);
      const double d_r = 2 * k * inverse, d_z = (1 - k * k) * inverse;
      const double w_d = w_x * d_r * azimuth.cosine + w_z * d_z;
      const double h_x = alpha * d_r * azimuth.cosine;
      const double norm2 = 1 / (a2 * d_r * d_r + d_z * d_z);
      const double v_h = sine * h_x + cosine * d_z;  // times |h|
      const double above = 2 * v_h * d_z * norm2 - cosine, l_z = above > 0 ? above : 0;
      const double visible = l_z * open;
      const double masking = visible / (visible + 0.5 * (smith(l_z) - l_z));
      const double measure = 2 * limit * inverse * d_r * weights[i] * azimuth.weight;
      const double weight = 4 / (1 + w_z) * w_d * measure * masking;
      const double miss = 1 - v_h * std::sqrt(norm2), miss2 = miss * miss;
      const double fresnel = miss2 * miss2 * miss;
      scales[i] = weight * (1 - fresnel);
      biases[i] = weight * fresnel;
    }
    for (size_t i = 0; i < radii; ++i) {
      sum.scale += scales[i];
      sum.bias += biases[i];
    }
  }
  return sum;
}

}  // namespace

DfgValue DfgIntegral::at(double alpha, double cosine) const {
  assert(alpha > 0 && alpha <= 1 && cosine > 0 && cosine <= 1);
  return integrate(alpha, cosine, nodes_);
}

DfgValue ggx_dfg(double alpha, double cosine, int refinement) {
  constexpr int kAzimuths = 10, kRadii = 20;
  static_assert(kDfgPoints == 2 * kAzimuths * kRadii);
  static const DfgIntegral usual(kAzimuths, kRadii);
  if (refinement == 1) return usual.at(alpha, cosine);
  return DfgIntegral(refinement * kAzimuths, refinement * kRadii).at(alpha, cosine);
}

double compensated_reflectance(const DfgValue& value, double f0) {
  const double white = value.scale + value.bias;
  return (f0 * value.scale + value.bias) * (1 + f0 * (1 / white - 1));
}

namespace {

constexpr double kFloat = 6e-8;  // half a step of float below 1

const DfgRule& ggx_rule(const DfgTableOptions& options) {
  return dfg_rule(options.error - kFloat);
}
const CharlieRule& sheen_rule(const DfgTableOptions& options) {
  return charlie_rule(options.error - kFloat);
}

}  // namespace

Image dfg_table(int size, const DfgTableOptions& options, int threads, Progress& progress) {
  Image table(size, size, 3);
  const DfgRule& rule = ggx_rule(options);
  const DfgIntegral integral(rule.azimuths, rule.radii);
  const CharlieIntegral sheen(sheen_rule(options).points);
  parallel_blocks(static_cast<size_t>(size), 4, threads, progress, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const double roughness = (static_cast<double>(row) + 0.5) / size;
      const double alpha = roughness * roughness;
      for (int x = 0; x < size; ++x) {
        const double cosine = (x + 0.5) / size;
        const DfgValue value = integral.at(alpha, cosine);
        const double white = value.scale + value.bias;
        float* out = table.at(x, static_cast<int>(row));
        out[0] = static_cast<float>(options.multiple_scattering ? value.bias : value.scale);
        out[1] = static_cast<float>(options.multiple_scattering ? white : value.bias);
        if (options.charlie) out[2] = static_cast<float>(sheen.at(alpha, cosine));
      }
    }
  });
  return table;
}

double dfg_table_bound(const DfgTableOptions& options) {
  const double sheen = options.charlie ? sheen_rule(options).error_bound : 0.0;
  return std::max(ggx_rule(options).error_bound, sheen) + kFloat;
}

DfgTableWork dfg_table_work(const DfgTableOptions& options) {
  const int sheen = options.charlie ? sheen_rule(options).points : 0;
  return {ggx_rule(options).points(), sheen * sheen};
}

}  // namespace lightkiln

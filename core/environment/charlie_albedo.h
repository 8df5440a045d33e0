#pragma once

// How much white light a sheen layer reflects: the third channel of DFG tables.

#include <span>
#include <vector>

namespace lightkiln {

// A quadrature of the albedo's integral.
struct CharlieRule {
  int points;  // Gauss points of each dimension
  // The largest error over roughness and cosine in [1/2048, 1], relative to max(1, value), with a
  // margin of a third or more over what a dense grid of both shows.
  double error_bound;
};
// By cost, the cheapest first.
std::span<const CharlieRule> charlie_rules();
// The cheapest rule whose bound is at most `error`, and the finest when none is so exact.
const CharlieRule& charlie_rule(double error);

class CharlieIntegral {
 public:
  explicit CharlieIntegral(int points);
  // integral over the upper hemisphere of D(h) V(l, v) n.l dl, with Charlie's distribution and the
  // visibility 1 / (4 (n.l + n.v - n.l n.v)). alpha = roughness^2 in (0, 1]; cosine = n.v in (0,
  // 1]. The model does not conserve energy: at grazing views of low roughness the value exceeds 1.
  double at(double alpha, double cosine) const;

 private:
  std::vector<double> cosine_, weight_;
  std::vector<double> opening_, azimuth_weight_;  // opening = 1 + cos(azimuth)
};

// By 20 points a dimension, to 1.5e-5; `refinement` multiplies them.
double charlie_albedo(double alpha, double cosine, int refinement = 1);

}  // namespace lightkiln

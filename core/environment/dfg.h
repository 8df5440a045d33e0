#pragma once

// The split-sum table of GGX with height-correlated Smith masking: the reflected share of white
// light is F0 scale + bias, with Schlick's Fresnel term.

#include <span>
#include <vector>

#include "core/base/progress.h"
#include "core/image/image.h"

namespace lightkiln {

struct DfgValue {
  double scale = 0;  // multiplies F0
  double bias = 0;
};

// A quadrature of the table's integral.
struct DfgRule {
  int azimuths;  // Gauss points on each side of a right angle
  int radii;     // Gauss points along a radius
  // The largest error of either value over alpha in [1e-7, 1] and cosine in [1/2048, 1], with a
  // margin of a third or more over what a dense grid of both shows.
  double error_bound;
  int points() const { return 2 * azimuths * radii; }
};
// By cost, the cheapest first.
std::span<const DfgRule> dfg_rules();
// The cheapest rule whose bound is at most `error`, and the finest when none is so exact.
const DfgRule& dfg_rule(double error);

struct DfgNodes {
  struct Azimuth {
    double cosine, sine, weight;
  };
  std::vector<Azimuth> azimuths;       // of (0, pi); weights sum to 1
  std::vector<double> radii, weights;  // in (0, 1)
};

class DfgIntegral {
 public:
  // At most kMostDfgRadii radii.
  DfgIntegral(int azimuths, int radii);
  // alpha = roughness^2 in (0, 1]; cosine = n.v in (0, 1]. Single scattering.
  DfgValue at(double alpha, double cosine) const;

 private:
  DfgNodes nodes_;
};
inline constexpr int kMostDfgRadii = 320;

// By 10 x 20 points, to 1e-5; `refinement` in 1..16 multiplies both.
DfgValue ggx_dfg(double alpha, double cosine, int refinement = 1);
inline constexpr int kDfgPoints = 2 * 10 * 20;

// What an infinitely deep play of reflections between microfacets would give back, as engines
// estimate it: reflected = (F0 scale + bias) (1 + F0 (1 / E - 1)), E = scale + bias, which is 1 for
// F0 = 1.
double compensated_reflectance(const DfgValue& value, double f0);

// What a table's channels hold.
struct DfgTableOptions {
  // false: R = scale, G = bias, as glTF viewers read: F0 R + G.
  // true: R = bias, G = E = scale + bias, as Filament reads for energy compensation:
  // mix(R, G, F0) (1 + F0 (1 / G - 1)).
  bool multiple_scattering = false;
  bool charlie = false;  // B = charlie_albedo(), else 0
  // What each entry may err by; of sheen's albedo above 1, relative.
  double error = 1e-5;
};
// size x size, three channels. Column x holds n.v = (x + 1/2) / size, row y (from the top)
// roughness = (y + 1/2) / size.
// dfg_table_bound() says what entries err by: the rules' bounds and the rounding to float.
Image dfg_table(int size, const DfgTableOptions& options, int threads, Progress& progress);
double dfg_table_bound(const DfgTableOptions& options);
// Points of each integral that an entry takes.
struct DfgTableWork {
  int ggx = 0, sheen = 0;
};
DfgTableWork dfg_table_work(const DfgTableOptions& options);

}  // namespace lightkiln

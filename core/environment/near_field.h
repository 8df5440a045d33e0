#pragma once

// The core of a narrow GGX lobe, integrated over the map's own texels: the part that no affordable
// band limit could draw.

#include <array>
#include <vector>

#include "core/environment/ggx_lobe.h"
#include "core/image/image.h"

namespace lightkiln {

// Sums radiance times the integral of the core (see GgxHalo) over every texel within reach of a
// direction. A texel counts as constant on its spherical rectangle. Texels are cut and given Gauss
// points until the core at distance t is known to tolerance (1 + t^2 / 4 alpha^2) of the lobe, and
// never worse than kWorstTolerance; what lies beyond the reach is less than that share of the lobe.
class NearField {
 public:
  static constexpr double kWorstTolerance = 3e-6;
  // The norm of the error over the sphere is at most this many tolerances of the lobe's own norm.
  static constexpr double kNormFactor = 2 * 1.7321;

  // The map must outlive the object.
  NearField(const Image& latlong, double alpha, double split, double tolerance);

  double reach_rad() const { return reach_; }
  // Points that one direction on the equator takes: what its time is proportional to.
  double typical_points() const;

  // Room for one thread.
  struct Workspace {
    std::vector<double> column_x, column_weight, values;
    std::vector<size_t> column_first;
    std::vector<int> columns;
    std::vector<double> row_nodes, row_weights;
  };
  Vec3d at(const Vec3d& direction, Workspace& work) const;

 private:
  static constexpr int kMostPoints = 8;
  static constexpr int kSteps = 24;

  double tolerance_at(double distance) const;
  // Gauss points of the interval [from, to] of offsets from the direction, cut so that each piece
  // is no wider than the lobe allows there. An offset x is scale x wide and at least
  // asin(sine sin x) away (sine < 0: x itself).
  void place_points(double from, double to, double scale, double sine, std::vector<double>& nodes,
                    std::vector<double>& weights) const;
  void cut_columns(double theta, double phi, Workspace& work) const;

  const Image& map_;
  GgxLobe lobe_;
  double split_, tolerance_, reach_;
  // [step][points]: the widest piece over the lobe's scale at a distance where 1 + t^2 / 4 alpha^2
  // is at least 2^step.
  std::array<std::array<double, kMostPoints + 1>, kSteps> widest_;
};

}  // namespace lightkiln

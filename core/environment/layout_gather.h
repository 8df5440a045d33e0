#pragma once

// One texel of a conversion of layouts: what it shows of the source, weighted by solid angle.

#include <array>
#include <optional>

#include "core/environment/layout_convert.h"
#include "core/environment/polygon_coverage.h"

namespace lightkiln {

// What all texels of a conversion share.
struct ConversionTask {
  const ConversionSource& source;
  MapLayout to;
  Rotation rotation;
  MapFilter filter;
  double error;  // as ordered, see convert_layout()
  bool turned;
  int turn;               // columns of a whole turn of the source, 0 = it does not close
  int least;              // of halving any texel: cells wider than 4 degrees have curved edges
  double span_x, span_y;  // the widest cell that is taken for a polygon, in source texels
  int seam_depth;         // of halving that leaves eight cells to a source texel's side
  int reach;              // source texels about a corner that a texel may show
};
ConversionTask make_conversion(const ConversionSource& source, const MapLayout& to,
                               const Rotation& rotation, MapFilter filter, double error);

// A point of the target's image and where the source shows it.
struct CellCorner {
  bool shown = false;    // the target shows a direction here
  bool covered = false;  // and the source covers it
  MapPlace place;
};
CellCorner locate(const ConversionTask& task, double x, double y);

// A rectangle of the target and its corners: top left, top right, bottom right, bottom left.
struct TargetCell {
  double x0, y0, x1, y1;
  std::array<CellCorner, 4> corners;
};
TargetCell locate_corners(const ConversionTask& task, TargetCell cell);

// A rectangle of the target that is one picture: a face, or the whole image.
struct TargetBlock {
  int x, y, columns, rows;
};
// Of texel (x, y).
TargetBlock block_of(const MapLayout& layout, int x, int y);
// Lines between texels, held off borders that belong to two faces or are all one direction (the
// poles, whose longitude would be lost), and off what lies beyond the samples of the openexr
// convention.
double grid_line(const MapLayout& layout, int line, int start, int count);
// Texel (x, y) of a block between such lines.
TargetCell texel_cell(const MapLayout& layout, const TargetBlock& block, int x, int y,
                      const std::array<CellCorner, 4>& corners);

// The polygon of a cell in the source's picture.
struct CellOutline {
  std::array<GridPoint, 4> points;
  int chart = 0;
  // The two sides, what they enclose, and the smaller extent of that parallelogram: the smaller
  // singular value of the matrix of both.
  double ax = 0, ay = 0, bx = 0, by = 0;
  double area = 0, smaller = 0;

  // The same extent at corner i alone.
  double smaller_at(size_t i) const;
};
// None when the corners are not on one piece of the picture or lie too far apart for straight
// edges.
std::optional<CellOutline> outline_of(const ConversionTask& task,
                                      const std::array<CellCorner, 4>& corners);

// The share of a texel's weights that may be misplaced for the error that was ordered, by the range
// of the source's values within reach of it; at most 1.
double allowed_misplacement(const ConversionTask& task, const TargetCell& cell,
                            const std::optional<CellOutline>& outline);

struct GatheredLight {
  Vec3d energy;
  double omega = 0;

  void add(const Vec3d& radiance, double weight) {
    energy += radiance * weight;
    omega += weight;
  }
  Vec3d mean() const { return omega > 0 ? energy / omega : Vec3d{}; }
  void write(float* rgb) const {
    const Vec3d value = mean();
    for (int c = 0; c < 3; ++c) rgb[c] = static_cast<float>(value[c]);
  }
};

// One thread's work on texels of the target.
class TexelGatherer {
 public:
  explicit TexelGatherer(const ConversionTask& task);

  // Adds what a whole texel, or the part of it that lies on one block, shows.
  void add_texel(const TargetCell& cell, GatheredLight* light);
  const ConversionWork& work() const { return work_; }

 private:
  void add(const TargetCell& cell, int level, GatheredLight* light);
  void add_outline(const TargetCell& cell, const CellOutline& outline, int level,
                   GatheredLight* light);
  bool smooths_unevenly(const CellOutline& outline, double size) const;
  double misplaced(const TargetCell& cell, const CellOutline& outline, double smooth);
  void add_area(const TargetCell& cell, const CellOutline& outline, double share,
                GatheredLight* light);
  void add_smooth(const TargetCell& cell, const CellOutline& outline, double share, int level,
                  GatheredLight* light);
  bool add_interpolated(const CellOutline& outline, double share, GatheredLight* light);
  void add_points(const TargetCell& cell, const CellOutline& outline, double share, int level,
                  GatheredLight* light);
  void add_point(const TargetCell& cell, GatheredLight* light);
  void split(const TargetCell& cell, int level, GatheredLight* light);
  CellCorner look_up(double x, double y);
  int column(int x) const;
  double solid_angle(const TargetCell& cell) const;

  const ConversionTask& task_;
  bool radial_;
  double allowed_ = 0;  // of the present texel, see allowed_misplacement()
  PolygonCoverage coverage_;
  ConversionWork work_;
};

}  // namespace lightkiln

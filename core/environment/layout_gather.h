#pragma once

// One texel of a conversion of layouts: what it shows of the source, weighted by solid angle.

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "core/environment/layout_convert.h"
#include "core/environment/polygon_coverage.h"
#include "core/sphere/rim_patches.h"

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
  double not_asked;       // where more than this may be misplaced nothing is looked for
};
ConversionTask make_conversion(const ConversionSource& source, const MapLayout& to,
                               const Rotation& rotation, MapFilter filter, double error);

// A point of the target's image and where the source shows it.
struct CellCorner {
  bool shown = false;    // the target shows a direction here
  bool covered = false;  // and the source covers it
  GridPoint at;          // in the target
  MapPlace place;
};
CellCorner locate(const ConversionTask& task, double x, double y);
// The same in the coordinates of a patch.
CellCorner locate(const ConversionTask& task, const RimPatch& patch, double a, double b);

// About a pole, at row y of the source, a few texels are the whole turn.
bool by_pole(const ConversionTask& task, double y);

// A rectangle of the target, or of a patch's coordinates, and its corners: top left, top right,
// bottom right, bottom left.
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

// Source texels that a texel of the target spans in the direction in which it spans the fewest:
// the smaller singular value of the map from sides in the target to sides in the source.
double smaller_span(GridPoint first, GridPoint second, GridPoint source_first,
                    GridPoint source_second);

// The polygon of a cell in the source's picture.
struct CellOutline {
  std::array<GridPoint, 4> points, target;
  int chart = 0;
  // The mean of opposite sides, what they enclose, and smaller_span() by them.
  double ax = 0, ay = 0, bx = 0, by = 0;
  double area = 0, span = 0;
  bool wide = false;  // too wide for straight edges

  // Of the longer of two opposite sides.
  double first_length() const;
  double second_length() const;
  // Far longer than wide.
  bool slender() const;
  // No parallelogram: opposite sides differ.
  bool skewed() const;
};
// None when the corners are not on one piece of the picture, or about a pole.
std::optional<CellOutline> outline_of(const ConversionTask& task,
                                      const std::array<CellCorner, 4>& corners);

// The range of the source's values, and the brightest of them.
struct ValueRange {
  float low[3] = {1e38f, 1e38f, 1e38f}, high[3] = {0, 0, 0};

  void add(const float* value);
  double brightest() const { return double(std::max({high[0], high[1], high[2]})); }
  double spread() const;
};
// Adds all that a cell may show.
void add_values(const ConversionTask& task, const TargetCell& cell,
                const std::optional<CellOutline>& outline, ValueRange* range);

// The share of a texel's weights that may be misplaced for the error that was ordered, by the range
// of what it may show; at most 1.
double allowed_misplacement(const ConversionTask& task, const ValueRange& range);

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

struct CellBends;
struct SmoothShare;

// One thread's work on texels of the target.
class TexelGatherer {
 public:
  explicit TexelGatherer(const ConversionTask& task);

  // Adds what a whole texel, or the part of it that lies on one block, shows.
  void add_texel(const TargetCell& cell, GatheredLight* light);
  const ConversionWork& work() const { return work_; }

 private:
  // How a cell is laid over the source.
  struct Shape {
    const CellBends* bends = nullptr;  // null = straight edges
    bool by_points = false;
  };

  void add(const TargetCell& cell, int level, GatheredLight* light);
  void add_outline(const TargetCell& cell, const CellOutline& outline, int level,
                   GatheredLight* light);
  void add_rim(const std::vector<RimPatch>& patches, GatheredLight* light);
  bool look_along_edges(const TargetCell& cell, const CellOutline& outline, CellBends* bends);
  void cover(const CellOutline& outline, const CellBends* bends, double shift);
  void lay_over(const TargetCell& cell, const CellOutline& outline, const SmoothShare& smooth,
                int level, const Shape& shape, GatheredLight* light);
  void add_area(const CellOutline& outline, const CellBends* bends, const SmoothShare& smooth,
                GatheredLight* light);
  bool add_interpolated(const CellOutline& outline, const CellBends* bends,
                        const SmoothShare& smooth, GatheredLight* light);
  // Points a texel's side for what was ordered.
  double fineness() const;
  void add_points(const TargetCell& cell, const CellOutline& outline, const CellBends* bends,
                  const SmoothShare& smooth, int level, GatheredLight* light);
  void add_point(const TargetCell& cell, GatheredLight* light);
  void split(const TargetCell& cell, int level, GatheredLight* light);
  void halve(const TargetCell& cell, bool by_columns, int level, GatheredLight* light);
  void divide(const TargetCell& cell, const CellOutline& outline, int level, GatheredLight* light);
  CellCorner look_up(double x, double y);
  double smooth_share_at(const TargetCell& cell, const CellCorner& centre);
  int column(int x) const;
  double solid_angle(const TargetCell& cell) const;

  const ConversionTask& task_;
  bool radial_;
  const RimPatch* patch_ = nullptr;  // whose coordinates cells are in; null = the image's own
  double part_ = 1;                  // of the texel that this patch is
  double allowed_ = 0;               // of the present texel, see allowed_misplacement()
  PolygonCoverage coverage_;
  ConversionWork work_;
};

}  // namespace lightkiln

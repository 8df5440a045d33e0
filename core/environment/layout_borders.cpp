#include "core/environment/layout_borders.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/environment/layout_gather.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

// The texels that show one direction in the openexr convention, in one order whichever of them is
// asked for: the last column repeats the first, the first and last rows are the poles, and faces
// share their borders.
struct Texel {
  int x, y;
};
std::vector<Texel> repeats(const MapLayout& layout, int x, int y) {
  if (layout.kind == LayoutKind::latlong) {
    if (y > 0 && y < layout.height - 1) return {{0, y}, {layout.width - 1, y}};
    std::vector<Texel> row;
    for (int i = 0; i < layout.width; ++i) row.push_back({i, y});
    return row;
  }
  const int last = layout.width - 1;
  const Vec3d d = layout_direction(layout, x + 0.5, y + 0.5).value();
  const double largest = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  std::vector<Texel> texels;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(d[axis]) < largest * (1 - 1e-9)) continue;
    Vec3d towards = d;
    towards[axis] *= 1 + 1e-8;
    int face = 0;
    double u = 0, v = 0;
    cube_coordinates(towards, &face, &u, &v);
    texels.push_back({static_cast<int>(std::lround(u * last)),
                      face * layout.width + static_cast<int>(std::lround(v * last))});
  }
  return texels;
}

}  // namespace

void fill_borders(const ConversionTask& task, const TargetBlock& block, Image* image,
                  Progress& progress) {
  TexelGatherer gatherer(task);
  const int right = block.x + block.columns - 1, bottom = block.y + block.rows - 1;
  const bool poles = task.to.kind == LayoutKind::latlong;
  for (int y = block.y; y <= bottom; ++y) {
    progress.check();
    const bool edge_row = y == block.y || y == bottom;
    for (int x = block.x; x <= right; x = edge_row || x == right ? x + 1 : right) {
      if (poles && edge_row && x > block.x) {
        std::copy_n(image->at(block.x, y), 3, image->at(x, y));
        continue;
      }
      GatheredLight light;
      for (const Texel& texel : repeats(task.to, x, y)) {
        const TargetBlock own = poles ? block
                                      : TargetBlock{0, texel.y / block.columns * block.columns,
                                                    block.columns, block.columns};
        const TargetCell shape = texel_cell(task.to, own, texel.x, texel.y, {});
        gatherer.add_texel(locate_corners(task, shape), &light);
      }
      light.write(image->at(x, y));
    }
  }
}

}  // namespace lightkiln

#include "core/environment/light_cells.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/environment/latlong_grid.h"

namespace lightkiln {

namespace {

constexpr int kBlocksAcross = 256;
constexpr double kLargestShare = 1e-3;  // of all light in one cell that could be cut

// A rectangle of texels.
struct Block {
  int x0, y0, x1, y1;
};

LightCell gather(const LatlongGrid& grid, const Block& block) {
  LightCell cell;
  Vec3d moment;
  for (int y = block.y0; y < block.y1; ++y) {
    const double solid_angle = grid.solid_angle({block.x0, y});
    for (int x = block.x0; x < block.x1; ++x) {
      const Vec3d radiance = grid.radiance({x, y});
      if (radiance == Vec3d{}) continue;
      cell.energy += radiance * solid_angle;
      moment += grid.moment({x, y}) * luminance(radiance);
    }
  }
  cell.weight = luminance(cell.energy);
  if (!(cell.weight > 0)) return cell;
  cell.centre = moment / cell.weight;
  // Directions d in the cell vary by mean |d - centre|^2 = 1 - |centre|^2 along two axes; an even
  // spread over +-h varies by h^2 / 3 along each.
  cell.extent = std::sqrt(1.5 * std::max(0.0, 1 - dot(cell.centre, cell.centre)));
  return cell;
}

// Appends the block, or its four parts as long as they hold too much.
void cut(const LatlongGrid& grid, const Block& block, const LightCell& cell, double limit,
         std::vector<LightCell>* cells) {
  if (!(cell.weight > 0)) return;
  if (cell.weight <= limit || (block.x1 - block.x0 <= 1 && block.y1 - block.y0 <= 1)) {
    cells->push_back(cell);
    return;
  }
  const int x = (block.x0 + block.x1 + 1) / 2, y = (block.y0 + block.y1 + 1) / 2;
  for (const Block& part : {Block{block.x0, block.y0, x, y}, Block{x, block.y0, block.x1, y},
                            Block{block.x0, y, x, block.y1}, Block{x, y, block.x1, block.y1}}) {
    if (part.x0 == part.x1 || part.y0 == part.y1) continue;
    cut(grid, part, gather(grid, part), limit, cells);
  }
}

}  // namespace

LightCells gather_light(const Environment& environment, int threads, Progress& progress) {
  const LatlongGrid grid(environment.radiance);
  const int side = (grid.width() + kBlocksAcross - 1) / kBlocksAcross;
  const int columns = (grid.width() + side - 1) / side, rows = (grid.height() + side - 1) / side;
  const auto block_of = [&](size_t i) {
    const int x = static_cast<int>(i) % columns * side, y = static_cast<int>(i) / columns * side;
    return Block{x, y, std::min(x + side, grid.width()), std::min(y + side, grid.height())};
  };
  std::vector<LightCell> blocks(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  parallel_blocks(blocks.size(), static_cast<size_t>(columns), threads, progress,
                  [&](size_t begin, size_t end) {
                    for (size_t i = begin; i < end; ++i) blocks[i] = gather(grid, block_of(i));
                  });
  LightCells light;
  for (const LightCell& block : blocks) light.energy += block.energy;
  light.weight = luminance(light.energy);
  for (size_t i = 0; i < blocks.size(); ++i) {
    cut(grid, block_of(i), blocks[i], kLargestShare * light.weight, &light.cells);
  }
  return light;
}

// The mean of max(0, x) over x in [c - h, c + h] is c above h, 0 below -h and (c + h)^2 / 4h
// between.
Vec3d cell_irradiance(const LightCells& light, const Vec3d& normal) {
  Vec3d sum;
  for (const LightCell& cell : light.cells) {
    const double cosine = dot(normal, cell.centre), top = cosine + cell.extent;
    if (top <= 0) continue;
    sum += cell.energy * (cosine >= cell.extent ? cosine : top * top / (4 * cell.extent));
  }
  return sum;
}

}  // namespace lightkiln

#include "core/environment/layout_convert.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/environment/layout_borders.h"
#include "core/environment/layout_gather.h"
#include "core/environment/resample.h"
#include "core/sphere/cube_cross.h"
#include "core/sphere/radial_map.h"

namespace lightkiln {

namespace {

std::vector<TargetBlock> blocks_of(const MapLayout& layout) {
  if (!is_cube(layout.kind)) return {{0, 0, layout.width, layout.height}};
  const int size = cube_face_size(layout);
  std::vector<TargetBlock> blocks;
  for (int face = 0; face < 6; ++face) {
    const FacePlace place = face_place(layout.kind, face);
    blocks.push_back({place.column * size, place.row * size, size, size});
  }
  return blocks;
}

std::vector<CellCorner> corner_line(const ConversionTask& task, const TargetBlock& block,
                                    int line) {
  const double y = grid_line(task.to, line, block.y, block.rows);
  std::vector<CellCorner> corners;
  corners.reserve(static_cast<size_t>(block.columns) + 1);
  for (int x = block.x; x <= block.x + block.columns; ++x) {
    corners.push_back(locate(task, grid_line(task.to, x, block.x, block.columns), y));
  }
  return corners;
}

void fill_rows(const ConversionTask& task, const TargetBlock& block, int first, int end,
               Image* image) {
  TexelGatherer gatherer(task);
  std::vector<CellCorner> above = corner_line(task, block, first);
  for (int y = first; y < end; ++y) {
    std::vector<CellCorner> below = corner_line(task, block, y + 1);
    for (int x = block.x; x < block.x + block.columns; ++x) {
      const size_t i = static_cast<size_t>(x - block.x);
      GatheredLight light;
      gatherer.add_texel(
          texel_cell(task.to, block, x, y, {above[i], above[i + 1], below[i + 1], below[i]}),
          &light);
      light.write(image->at(x, y));
    }
    above.swap(below);
  }
}

// Moves whole faces from one cube layout to another.
Image move_faces(const MapLayout& from, const Image& source, const MapLayout& to) {
  const int size = cube_face_size(from);
  Image image(to.width, to.height, 3);
  for (int face = 0; face < 6; ++face) {
    const FacePlace a = face_place(from.kind, face), b = face_place(to.kind, face);
    const bool turn = a.half_turn != b.half_turn;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const int i = turn ? size - 1 - x : x, j = turn ? size - 1 - y : y;
        std::copy_n(source.at(a.column * size + x, a.row * size + y), 3,
                    image.at(b.column * size + i, b.row * size + j));
      }
    }
  }
  return image;
}

void check_target(const MapLayout& to) {
  if (layout_fault(to) != nullptr) throw Error(ErrorCode::invalid_input, layout_fault(to));
}

// The closed-form walk of resample.h does what `area` does, exactly and at a fraction of the cost,
// where a cube's texels are wide enough to need no smoothing.
bool walks_meridians(const ConversionTask& task) {
  const MapLayout &from = task.source.layout, &to = task.to;
  return !task.turned && from.kind == LayoutKind::latlong && is_cube(to.kind) &&
         from.convention == TexelConvention::half_texel &&
         to.convention == TexelConvention::half_texel &&
         (task.filter == MapFilter::area || 8 * cube_face_size(to) <= from.width);
}

Image move_texels(const MapLayout& from, const Image& source, const MapLayout& to) {
  return from == to ? source : move_faces(from, source, to);
}

}  // namespace

bool moves_texels(const MapLayout& from, const MapLayout& to, const Rotation& rotation) {
  if (!rotation.is_identity()) return false;
  return from == to ||
         (is_cube(from.kind) && is_cube(to.kind) && from.convention == to.convention &&
          cube_face_size(from) == cube_face_size(to));
}

Image convert_layout(const ConversionSource& source, const MapLayout& to, const Rotation& rotation,
                     MapFilter filter, double error, int threads, Progress& progress) {
  check_target(to);
  if (moves_texels(source.layout, to, rotation)) {
    return move_texels(source.layout, *source.image, to);
  }
  const ConversionTask task = make_conversion(source, to, rotation, filter, error);
  if (walks_meridians(task)) {
    const int size = cube_face_size(to);
    return move_faces(make_layout(LayoutKind::cube_strip, size),
                      resample_to_cube(*source.image, size, threads, progress), to);
  }
  Image image(to.width, to.height, 3);
  const std::vector<TargetBlock> blocks = blocks_of(to);
  const size_t rows = static_cast<size_t>(blocks[0].rows);
  constexpr size_t kRows = 8;
  const size_t groups = (rows + kRows - 1) / kRows;
  parallel_blocks(groups * blocks.size(), 1, threads, progress, [&](size_t group, size_t) {
    const TargetBlock& block = blocks[group / groups];
    const size_t first = group % groups * kRows;
    fill_rows(task, block, block.y + static_cast<int>(first),
              block.y + static_cast<int>(std::min(rows, first + kRows)), &image);
  });
  if (to.convention == TexelConvention::openexr) {
    for (const TargetBlock& block : blocks) fill_borders(task, block, &image, progress);
  }
  return image;
}

Image convert_layout(const MapLayout& from, const Image& source, const MapLayout& to,
                     const Rotation& rotation, MapFilter filter, int threads, Progress& progress) {
  check_source(from, source);
  check_target(to);
  if (moves_texels(from, to, rotation)) return move_texels(from, source, to);
  return convert_layout(ConversionSource(from, source), to, rotation, filter, kConversionError,
                        threads, progress);
}

namespace {

void add_texel_at(const ConversionTask& task, double x, double y, TexelGatherer* gatherer) {
  const int i = std::clamp(static_cast<int>(x), 0, task.to.width - 1);
  const int j = std::clamp(static_cast<int>(y), 0, task.to.height - 1);
  GatheredLight light;
  gatherer->add_texel(locate_corners(task, texel_cell(task.to, block_of(task.to, i, j), i, j, {})),
                      &light);
}

void add_work(const ConversionWork& part, double scale, ConversionWork* work) {
  work->texels += scale * part.texels;
  work->places += scale * part.places;
  work->polygons += scale * part.polygons;
  work->covered += scale * part.covered;
  work->points += scale * part.points;
}

// The outermost texels of a disc are few and cost many times what others do; they are counted
// apart.
constexpr double kRimBand = 8;  // texels

bool in_rim_band(const MapLayout& to, double x, double y) {
  const double half = 0.5 * to.width, radius = std::hypot(x - half, y - half);
  return radius > half - kRimBand && radius <= half;
}

// Adds what that band costs and returns its area in texels; 0 without one.
double add_rim_work(const ConversionTask& task, ConversionWork* work) {
  const double half = 0.5 * task.to.width, inner = half - kRimBand;
  if (!is_radial(task.to.kind) || half < 8 * kRimBand) return 0;
  constexpr int kTexels = 256;
  TexelGatherer gatherer(task);
  const double squares = half * half - inner * inner;
  for (int i = 1; i <= kTexels; ++i) {
    const double u = 0.5 + i * 0.7548776662466927, v = 0.5 + i * 0.5698402909980532;
    const double phi = 2 * kPi * (u - std::floor(u));
    const double radius = std::sqrt(inner * inner + (v - std::floor(v)) * squares);
    add_texel_at(task, half + radius * std::cos(phi), half + radius * std::sin(phi), &gatherer);
  }
  const double area = kPi * squares;
  work->looked_at += kTexels;
  add_work(gatherer.work(), area / kTexels, work);
  return area;
}

}  // namespace

ConversionWork estimate_conversion(const ConversionSource& source, const MapLayout& to,
                                   const Rotation& rotation, MapFilter filter, double error) {
  constexpr int kTexels = 1024, kFewest = 8;
  ConversionWork work;
  if (moves_texels(source.layout, to, rotation)) return work;
  const ConversionTask task = make_conversion(source, to, rotation, filter, error);
  const int size = is_cube(to.kind) ? cube_face_size(to) : 0;
  const double texels = size > 0 ? 6.0 * size * size : double(to.width) * to.height;
  if (walks_meridians(task)) {
    work.texels = texels;
    work.walked = true;
    return work;
  }
  for (const MapLayout& layout : {source.layout, to}) {
    if (is_radial(layout.kind)) work.per_place += 0.3;
    if (layout.camera_distance > 0) work.per_place += 0.8;
  }
  const double band = add_rim_work(task, &work);
  TexelGatherer gatherer(task);
  int sampled = 0;
  const auto sample = [&](double x, double y) {
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    if (size > 0 && !texel_has_direction(to, i, j)) return;
    if (band > 0 && in_rim_band(to, x, y)) return;
    add_texel_at(task, x, y, &gatherer);
    ++sampled;
  };
  // The fewer texels a target has, the more of the source each one shows: a quarter of them takes a
  // quarter of the conversion.
  const int wanted = std::clamp(static_cast<int>(texels / 4), kFewest, kTexels);
  if (texels <= wanted) {
    for (int i = 0; i < to.width * to.height; ++i) {
      sample(i % to.width + 0.5, i / to.width + 0.5);
    }
  }
  // Spread by the fractions of a plastic number, which fill a square evenly at any count.
  for (int i = 1; i <= 4 * wanted && sampled < std::min<double>(wanted, texels); ++i) {
    const double u = 0.5 + i * 0.7548776662466927, v = 0.5 + i * 0.5698402909980532;
    sample((u - std::floor(u)) * to.width, (v - std::floor(v)) * to.height);
  }
  if (sampled > 0) add_work(gatherer.work(), (texels - band) / sampled, &work);
  work.looked_at += sampled;
  return work;
}

}  // namespace lightkiln

#include "core/trace/textured_emission.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/image/ldr.h"
#include "core/trace/texture.h"

namespace lightkiln {

namespace {

constexpr int kMostCells = 1024;          // a side
constexpr double kMostEntries = 1 << 22;  // of a mesh, at the most
constexpr double kFarthest = 1 << 30;     // cells from the origin
constexpr double kLeastArea = 0x1p-40;    // of a triangle, in cells

// Up to three corners of a triangle and one more for each of four cuts.
struct Polygon {
  std::array<double, 8> x, y;
  size_t count = 0;
};

// What of a polygon lies on one side of x = at (or of y = at): above it, or below (Sutherland and
// Hodgman, "Reentrant Polygon Clipping", 1974).
Polygon cut(const Polygon& from, bool by_y, double at, bool above) {
  Polygon kept;
  const auto& key = by_y ? from.y : from.x;
  const auto inside = [&](size_t i) { return above ? key[i] >= at : key[i] <= at; };
  for (size_t i = 0; i < from.count; ++i) {
    const size_t next = i + 1 < from.count ? i + 1 : 0;
    if (inside(i)) {
      kept.x[kept.count] = from.x[i];
      kept.y[kept.count++] = from.y[i];
    }
    if (inside(i) == inside(next)) continue;
    const double t = (at - key[i]) / (key[next] - key[i]);
    kept.x[kept.count] = by_y ? from.x[i] + t * (from.x[next] - from.x[i]) : at;
    kept.y[kept.count++] = by_y ? at : from.y[i] + t * (from.y[next] - from.y[i]);
  }
  return kept;
}

Polygon row_of(const Polygon& triangle, double y) {
  return cut(cut(triangle, true, y, true), true, y + 1, false);
}
Polygon cell_of_row(const Polygon& row, double x) {
  return cut(cut(row, false, x, true), false, x + 1, false);
}

// Of the triangle of corners 0, i and i + 1.
double fan_area(const Polygon& p, size_t i) {
  return 0.5 * std::abs((p.x[i] - p.x[0]) * (p.y[i + 1] - p.y[0]) -
                        (p.x[i + 1] - p.x[0]) * (p.y[i] - p.y[0]));
}
double area(const Polygon& p) {
  double sum = 0;
  for (size_t i = 1; i + 1 < p.count; ++i) sum += fan_area(p, i);
  return sum;
}

}  // namespace

TexturedEmission::TexturedEmission(const SurfaceMesh& mesh, const TextureSlot& slot,
                                   const Texture& texture, const Vec3d& factor, double floor)
    : columns_{std::min(texture.width, kMostCells), texture.wrap_s},
      rows_{std::min(texture.height, kMostCells), texture.wrap_t} {
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto corner = [&](float u, float v) -> Place {
      const Vec2 uv = transform_texcoord(slot, interpolate_texcoord(mesh, slot.texcoord, t, u, v));
      return {static_cast<double>(uv.x), static_cast<double>(uv.y)};
    };
    triangles_.push_back({corner(0, 0), corner(1, 0), corner(0, 1)});
  }
  // Coarser until the mesh's entries are in hand.
  const auto scaled = [&](Triangle triangle) {
    for (Place* place : {&triangle.a, &triangle.b, &triangle.c}) {
      place->x *= columns_.size;
      place->y *= rows_.size;
    }
    return triangle;
  };
  const auto entries = [&] {
    double sum = 0;
    Box box;
    for (const Triangle& triangle : triangles_) {
      if (!box_of(scaled(triangle), &box)) continue;
      sum += static_cast<double>(box.x1 - box.x0) * static_cast<double>(box.y1 - box.y0);
    }
    return sum;
  };
  while (entries() > kMostEntries && (columns_.size > 1 || rows_.size > 1)) {
    columns_.size = std::max(1, columns_.size / 2);
    rows_.size = std::max(1, rows_.size / 2);
  }
  const bool in_hand = entries() <= kMostEntries;
  fill(texture, factor, floor);
  double whole = 0;
  for (const double value : cells_) whole += value / static_cast<double>(cells_.size());
  for (Triangle& triangle : triangles_) {
    triangle = scaled(triangle);
    triangle.mean = whole;
    if (in_hand) enter(triangle);
  }
}

// False for coordinates that are not finite or too far out.
bool TexturedEmission::box_of(const Triangle& t, Box* box) {
  for (const Place* place : {&t.a, &t.b, &t.c}) {
    if (!(std::abs(place->x) < kFarthest && std::abs(place->y) < kFarthest)) return false;
  }
  box->x0 = static_cast<int64_t>(std::floor(std::min({t.a.x, t.b.x, t.c.x})));
  box->y0 = static_cast<int64_t>(std::floor(std::min({t.a.y, t.b.y, t.c.y})));
  box->x1 = static_cast<int64_t>(std::floor(std::max({t.a.x, t.b.x, t.c.x}))) + 1;
  box->y1 = static_cast<int64_t>(std::floor(std::max({t.a.y, t.b.y, t.c.y}))) + 1;
  return true;
}

// Bilinear look-ups in a texel's square read its neighbours too: their mean over it weighs texels
// by (1, 6, 1) / 8 in each direction, the integral of the tent about a centre.
void TexturedEmission::fill(const Texture& texture, const Vec3d& factor, double floor) {
  std::array<double, 256> linear{};
  for (size_t i = 0; i < linear.size(); ++i) {
    linear[i] = static_cast<double>(srgb_to_linear(static_cast<uint8_t>(i)));
  }
  const int64_t width = texture.width, height = texture.height;
  const auto read = [&](int64_t x, int64_t y) {
    const uint8_t* p = &texture.rgba[static_cast<size_t>(4 * (y * width + x))];
    const Vec3d rgb = factor * Vec3d{linear[p[0]], linear[p[1]], linear[p[2]]};
    return std::max(0.0, luminance(rgb) - floor);
  };
  const auto neighbours = [](int64_t i, int64_t size, WrapMode wrap) {
    return std::array<int64_t, 3>{wrap_index(i - 1, size, wrap), i, wrap_index(i + 1, size, wrap)};
  };
  std::vector<double> texels(static_cast<size_t>(width * height)), smooth(texels.size());
  const auto at = [width](std::vector<double>& image, int64_t x, int64_t y) -> double& {
    return image[static_cast<size_t>(y * width + x)];
  };
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) at(texels, x, y) = read(x, y);
  }
  if (!texture.nearest) {
    for (int64_t y = 0; y < height; ++y) {
      for (int64_t x = 0; x < width; ++x) {
        const auto [left, here, right] = neighbours(x, width, texture.wrap_s);
        at(smooth, x, y) =
            (at(texels, left, y) + 6 * at(texels, here, y) + at(texels, right, y)) / 8;
      }
    }
    for (int64_t y = 0; y < height; ++y) {
      const auto [above, here, below] = neighbours(y, height, texture.wrap_t);
      for (int64_t x = 0; x < width; ++x) {
        at(texels, x, y) =
            (at(smooth, x, above) + 6 * at(smooth, x, here) + at(smooth, x, below)) / 8;
      }
    }
  }
  cells_.assign(static_cast<size_t>(columns_.size) * static_cast<size_t>(rows_.size), 0.0);
  const double share = static_cast<double>(cells_.size()) / static_cast<double>(texels.size());
  for (int64_t y = 0; y < height; ++y) {
    const int64_t row = y * rows_.size / height * columns_.size;
    for (int64_t x = 0; x < width; ++x) {
      cells_[static_cast<size_t>(row + x * columns_.size / width)] += share * at(texels, x, y);
    }
  }
}

double TexturedEmission::cell(int64_t x, int64_t y) const {
  const int64_t column = wrap_index(x, columns_.size, columns_.wrap);
  const int64_t row = wrap_index(y, rows_.size, rows_.wrap);
  return cells_[static_cast<size_t>(row * columns_.size + column)];
}

void TexturedEmission::enter(Triangle& triangle) {
  Box box;
  const Place &a = triangle.a, &b = triangle.b, &c = triangle.c;
  const double whole = 0.5 * std::abs((b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y));
  if (!box_of(triangle, &box) || !(whole > kLeastArea)) return;
  const Polygon corners{{a.x, b.x, c.x}, {a.y, b.y, c.y}, 3};
  triangle.first = entries_.size();
  double sum = 0;
  for (int64_t y = box.y0; y < box.y1; ++y) {
    const Polygon row = row_of(corners, static_cast<double>(y));
    if (row.count < 3) continue;
    const auto [least, most] =
        std::minmax_element(row.x.begin(), row.x.begin() + static_cast<std::ptrdiff_t>(row.count));
    const auto end = static_cast<int64_t>(std::floor(*most)) + 1;
    for (auto x = static_cast<int64_t>(std::floor(*least)); x < end; ++x) {
      const double bright = cell(x, y);
      if (!(bright > 0)) continue;
      const double shared = area(cell_of_row(row, static_cast<double>(x)));
      if (!(shared > 0)) continue;
      sum += bright * shared;
      entries_.push_back({static_cast<int32_t>(x), static_cast<int32_t>(y), sum});
    }
  }
  triangle.count = entries_.size() - triangle.first;
  for (size_t i = triangle.first; i < entries_.size(); ++i) entries_[i].end /= sum;
  triangle.mean = sum / whole;
  triangle.even = false;
}

// Uniform on a triangle: with s = sqrt(x), the barycentrics (1 - s, s (1 - y), s y) have constant
// density (Turk, "Generating random points in triangles", Graphics Gems, 1990). What is left of
// `choice` once it has chosen a cell is as uniform, and chooses a triangle of the cell's fan.
TexturedEmission::Point TexturedEmission::sample(uint32_t number, float choice, float x,
                                                 float y) const {
  const Triangle& t = triangles_[number];
  const double s = std::sqrt(static_cast<double>(x)), along = static_cast<double>(y);
  if (t.even) return {static_cast<float>(s * (1 - along)), static_cast<float>(s * along), 1};
  const auto first = entries_.begin() + static_cast<std::ptrdiff_t>(t.first);
  const auto last = first + static_cast<std::ptrdiff_t>(t.count) - 1;
  const auto chosen =
      std::upper_bound(first, last, static_cast<double>(choice),
                       [](double value, const Entry& entry) { return value < entry.end; });
  const double begin = chosen == first ? 0 : (chosen - 1)->end;
  const Polygon corners{{t.a.x, t.b.x, t.c.x}, {t.a.y, t.b.y, t.c.y}, 3};
  const Polygon part = cell_of_row(row_of(corners, chosen->y), chosen->x);
  double rest = (static_cast<double>(choice) - begin) / (chosen->end - begin) * area(part);
  size_t fan = 1;
  while (fan + 2 < part.count && rest >= fan_area(part, fan)) rest -= fan_area(part, fan++);
  const double w0 = 1 - s, w1 = s * (1 - along), w2 = s * along;
  const double px = w0 * part.x[0] + w1 * part.x[fan] + w2 * part.x[fan + 1] - t.a.x;
  const double py = w0 * part.y[0] + w1 * part.y[fan] + w2 * part.y[fan + 1] - t.a.y;
  const double bx = t.b.x - t.a.x, by = t.b.y - t.a.y, cx = t.c.x - t.a.x, cy = t.c.y - t.a.y;
  const double determinant = bx * cy - by * cx;
  const double u = std::clamp((px * cy - py * cx) / determinant, 0.0, 1.0);
  const double v = std::clamp((bx * py - by * px) / determinant, 0.0, 1 - u);
  return {static_cast<float>(u), static_cast<float>(v), cell(chosen->x, chosen->y) / t.mean};
}

double TexturedEmission::density(uint32_t number, float u, float v) const {
  const Triangle& t = triangles_[number];
  if (t.even) return 1;
  if (!(t.mean > 0)) return 0;
  const double along_u = static_cast<double>(u), along_v = static_cast<double>(v);
  const double x = t.a.x + along_u * (t.b.x - t.a.x) + along_v * (t.c.x - t.a.x);
  const double y = t.a.y + along_u * (t.b.y - t.a.y) + along_v * (t.c.y - t.a.y);
  return cell(static_cast<int64_t>(std::floor(x)), static_cast<int64_t>(std::floor(y))) / t.mean;
}

}  // namespace lightkiln

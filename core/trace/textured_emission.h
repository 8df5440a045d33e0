#pragma once

// Where a textured mesh shines: draws points of a triangle in proportion to the texels there, so
// that a hot spot of one texel is found however large the triangle is.
//
// Texture space is cut into cells, one a texel or, of large textures and of meshes that use them
// often, one for several. A cell holds the mean of what look-ups in it read, so it is dark only
// where nothing in it shines; in each triangle a cell is drawn by that mean times the area that it
// shares with the triangle, then an even point of what they share. The density is thus the cell's
// mean times one constant of the triangle.

#include <cstdint>
#include <vector>

#include "core/scene/scene.h"

namespace lightkiln {

class TexturedEmission {
 public:
  // Luminance of factor times texel, as far as it is above `floor`. `texture` is the slot's and has
  // texels.
  TexturedEmission(const SurfaceMesh& mesh, const TextureSlot& slot, const Texture& texture,
                   const Vec3d& factor, double floor);

  // Mean over a triangle; 0 only where nothing of it shines.
  double mean(uint32_t triangle) const { return triangles_[triangle].mean; }

  // A point with barycentrics (u, v) of corners 1 and 2, and its density over that of points
  // uniform on the triangle. `choice`, `x`, `y` in [0, 1); the triangle's mean is above 0.
  struct Point {
    float u = 0, v = 0;
    double density = 1;
  };
  Point sample(uint32_t triangle, float choice, float x, float y) const;
  // Of any point, as sample() tells it; 0 where the triangle's mean is.
  double density(uint32_t triangle, float u, float v) const;

 private:
  struct Place {
    double x = 0, y = 0;  // in cells
  };
  struct Axis {
    int size = 0;  // cells
    WrapMode wrap = WrapMode::repeat;
  };
  struct Triangle {
    Place a, b, c;  // corners
    double mean = 0;
    bool even = true;  // drawn evenly: texture coordinates that span no area, or are out of hand
    size_t first = 0;  // of its entries
    size_t count = 0;
  };
  // A cell that shines, or part of one, in the texture repeated as it wraps.
  struct Entry {
    int32_t x = 0, y = 0;
    double end = 0;  // of its share of the triangle's draws
  };
  struct Box {
    int64_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  };
  static bool box_of(const Triangle& triangle, Box* box);
  void fill(const Texture& texture, const Vec3d& factor, double floor);
  void enter(Triangle& triangle);
  double cell(int64_t x, int64_t y) const;

  Axis columns_, rows_;
  std::vector<double> cells_;  // [y * columns + x]
  std::vector<Triangle> triangles_;
  std::vector<Entry> entries_;
};

}  // namespace lightkiln

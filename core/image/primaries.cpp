// Sources: SMPTE RP 177-1993 (normalised primary matrix from chromaticities); Lam, "Metamerism and
// Colour Constancy", 1985, as tabulated by Lindbloom, "Chromatic Adaptation" (Bradford matrix).

#include "core/image/primaries.h"

#include <cassert>
#include <cmath>

#include "core/base/error.h"

namespace lightkiln {

namespace {

ColorMatrix multiply(const ColorMatrix& a, const ColorMatrix& b) {
  ColorMatrix product;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) product.m[i][j] += a.m[i][k] * b.m[k][j];
  return product;
}

Vec3d multiply(const ColorMatrix& a, const Vec3d& v) {
  Vec3d product;
  for (int i = 0; i < 3; ++i) product[i] = a.m[i][0] * v.x + a.m[i][1] * v.y + a.m[i][2] * v.z;
  return product;
}

ColorMatrix inverse(const ColorMatrix& a) {
  ColorMatrix result;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int r0 = (j + 1) % 3, r1 = (j + 2) % 3, c0 = (i + 1) % 3, c1 = (i + 2) % 3;
      result.m[i][j] = a.m[r0][c0] * a.m[r1][c1] - a.m[r0][c1] * a.m[r1][c0];
    }
  }
  const double determinant =
      a.m[0][0] * result.m[0][0] + a.m[0][1] * result.m[1][0] + a.m[0][2] * result.m[2][0];
  // Negated, so that NaN is caught too.
  if (!(std::abs(determinant) > 1e-9)) {
    throw Error(ErrorCode::invalid_input,
                "The colour primaries stated in the image span no colour space: red, green and "
                "blue must be three different points that are not on one line.");
  }
  for (auto& row : result.m)
    for (double& value : row) value /= determinant;
  return result;
}

// XYZ of chromaticity (x, y) at Y = 1: (x/y, 1, (1-x-y)/y).
Vec3d xyz_of(const Chromaticity& c) {
  if (!(std::abs(c.y) > 1e-6) || !std::isfinite(c.x) || !std::isfinite(c.y)) {
    throw Error(ErrorCode::invalid_input,
                "The colour primaries stated in the image are not chromaticities: every y must be "
                "finite and not zero.");
  }
  return {c.x / c.y, 1.0, (1.0 - c.x - c.y) / c.y};
}

// The columns of M are the XYZ of the primaries, each scaled by s so that M (1,1,1) = XYZ of white:
// with P = [xyz(red) xyz(green) xyz(blue)], s = P^-1 xyz(white) and M = P diag(s).
ColorMatrix rgb_to_xyz(const Primaries& p) {
  const Vec3d columns[3] = {xyz_of(p.red), xyz_of(p.green), xyz_of(p.blue)};
  ColorMatrix matrix;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) matrix.m[i][j] = columns[j][i];
  const Vec3d scale = multiply(inverse(matrix), xyz_of(p.white));
  for (auto& row : matrix.m)
    for (int j = 0; j < 3; ++j) row[j] *= scale[j];
  return matrix;
}

// Von Kries scaling in the Bradford cone space: A = B^-1 diag(B w_to / B w_from) B.
ColorMatrix adapt_white(const Chromaticity& from, const Chromaticity& to) {
  const ColorMatrix cone = {
      {{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};
  const Vec3d source = multiply(cone, xyz_of(from));
  const Vec3d target = multiply(cone, xyz_of(to));
  ColorMatrix scaled = cone;
  for (int i = 0; i < 3; ++i)
    for (double& value : scaled.m[i]) value *= target[i] / source[i];
  return multiply(inverse(cone), scaled);
}

bool same(const Chromaticity& a, const Chromaticity& b) {
  return std::abs(a.x - b.x) <= 1e-4 && std::abs(a.y - b.y) <= 1e-4;
}

}  // namespace

ColorMatrix matrix_to_rec709(const Primaries& from) {
  const Primaries rec709;
  const ColorMatrix matrix =
      multiply(inverse(rgb_to_xyz(rec709)),
               multiply(adapt_white(from.white, rec709.white), rgb_to_xyz(from)));
  for (const auto& row : matrix.m) {
    for (const double value : row) {
      if (!std::isfinite(value)) {
        throw Error(ErrorCode::invalid_input,
                    "The colour primaries stated in the image have a white point that no eye "
                    "adapts to.");
      }
    }
  }
  return matrix;
}

void convert_to_rec709(Image& image, const Primaries& from) {
  assert(image.channels == 3);
  const Primaries rec709;
  if (same(from.red, rec709.red) && same(from.green, rec709.green) &&
      same(from.blue, rec709.blue) && same(from.white, rec709.white))
    return;
  const ColorMatrix matrix = matrix_to_rec709(from);
  for (size_t i = 0; i + 2 < image.pixels.size(); i += 3) {
    const Vec3d rgb =
        multiply(matrix, Vec3d{image.pixels[i], image.pixels[i + 1], image.pixels[i + 2]});
    for (int c = 0; c < 3; ++c)
      image.pixels[i + static_cast<size_t>(c)] = static_cast<float>(rgb[c]);
  }
}

}  // namespace lightkiln

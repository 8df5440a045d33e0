#pragma once

// What a client orders of layouts: how the environment is read and turned, and as what it is
// written. Part of core/bake/spec.h.

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/environment/cube_faces.h"
#include "core/environment/source_layout.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/rotation.h"

namespace lightkiln {

// How the environment's file is to be read.
struct SourceParameters {
  // None (auto) = what the file's envmap attribute says, else lat-long, which is twice as wide as
  // high.
  std::optional<LayoutKind> layout;
  // None (auto) = openexr when the attribute names the layout, else half_texel.
  std::optional<TexelConvention> texel_convention;
  // mirror_ball: the camera's distance from the ball's centre in radii, > 1; none = infinitely far.
  // Refused for other layouts.
  std::optional<double> distance;
  // angular, mirror_ball: left and right are exchanged, as on a photograph of a ball. Refused for
  // other layouts.
  bool mirrored = false;
  // Of a cube_strip, or of a cube that comes as six files; of a cross, which is the same picture in
  // either. Refused for other layouts.
  FaceOrientation face_orientation = FaceOrientation::openexr;
  // NaN, infinite and negative pixels are refused with their counts; else set to 0 and counted.
  bool strict = false;

  friend bool operator==(const SourceParameters&, const SourceParameters&) = default;
};
SourceReading reading_of(const SourceParameters& parameters);

// Turns the environment before anything is made of it: what stood at d stands at R d. One of the
// two; the identity costs nothing and changes nothing.
struct RotationParameters {
  std::vector<double> quaternion = {0, 0, 0, 1};  // x, y, z, w; any length above zero
  double yaw_degrees = 0;  // -360..360, counter-clockwise seen from above: 90 turns +Z into +X

  friend bool operator==(const RotationParameters&, const RotationParameters&) = default;
};
Rotation rotation_of(const RotationParameters& parameters);

// How every cube of an order is written.
struct CubeParameters {
  // Of cube_strip, cube_faces and crosses under layouts, prefilter, sheen and irradiance; of both
  // cubes of a probe. Texels are moved, at no cost worth telling; crosses are the same picture in
  // either. opengl is refused where no cube is ordered.
  FaceOrientation face_orientation = FaceOrientation::openexr;

  friend bool operator==(const CubeParameters&, const CubeParameters&) = default;
};

struct LayoutOutput {
  // Texels: width of a lat-long map (even) or cylinder (even), 2..8192; side of a face, 1..2048 (2
  // with openexr); side of a square, 2..4096. Cost grows with its square.
  int size = 0;
  // Cylinder: rows, 1..4096; none = half the width. It covers latitudes up to atan(pi height /
  // width).
  std::optional<int> height;
  TexelConvention texel_convention = TexelConvention::half_texel;  // latlong, cube_strip
  std::optional<double> distance;  // mirror_ball: as in SourceParameters
  bool mirrored = false;           // angular, mirror_ball: as in SourceParameters
};

// A product for each LayoutKind, and six faces as six files.
inline constexpr size_t kCubeFaces = 12;
inline constexpr size_t kLayoutProducts = 13;
using LayoutOrders = std::array<std::optional<LayoutOutput>, kLayoutProducts>;

// As in specs and artifacts: layout_name(), or "cube_faces".
const char* layout_product_name(size_t product);
// With the size that stands for what is left out.
LayoutOutput default_layout_output(size_t product);
// The layout in memory; six faces are a strip until they are filed.
MapLayout layout_of(size_t product, const LayoutOutput& output);

}  // namespace lightkiln

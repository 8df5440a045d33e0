#include "core/environment/layout_sample.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/cube_cross.h"
#include "core/sphere/radial_map.h"

namespace lightkiln {

namespace {

int floor_to_int(double value) {
  const int truncated = static_cast<int>(value);
  return value < truncated ? truncated - 1 : truncated;
}

// All four samples around (x, y) lie in the image and in the face, and show something.
bool is_interior(const MapLayout& layout, int chart, int x, int y) {
  if (is_cube(layout.kind)) {
    const int size = cube_face_size(layout);
    const FacePlace face = face_place(layout.kind, chart - 1);
    const int i = x - face.column * size, j = y - face.row * size;
    return i >= 0 && j >= 0 && i + 1 < size && j + 1 < size;
  }
  if (x < 0 || y < 0 || x + 1 >= layout.width || y + 1 >= layout.height) return false;
  if (!is_radial(layout.kind)) return true;
  const double right = 2 * (x + 1.0) / layout.width - 1, down = 2 * (y + 1.0) / layout.height - 1;
  const double safe = 1 - 2.0 / layout.width;
  return safe > 0 && right * right + down * down < safe * safe;
}

// `blend` may be null.
Vec3d bilinear(const MapLayout& layout, const Image& image, const MapPlace& place,
               const RowBlend* blend) {
  const double px = place.x - 0.5, py = place.y - 0.5;
  const int x = floor_to_int(px), y = floor_to_int(py);
  const double fx = px - x;
  double fy = py - y;
  if (blend != nullptr) fy += (*blend)(y)*fy * (1 - fy);
  if (is_interior(layout, place.chart, x, y)) {
    const float* top = image.at(x, y);
    const float* bottom = image.at(x, y + 1);
    const double a = (1 - fx) * (1 - fy), b = fx * (1 - fy), c = (1 - fx) * fy, d = fx * fy;
    return {
        a * double(top[0]) + b * double(top[3]) + c * double(bottom[0]) + d * double(bottom[3]),
        a * double(top[1]) + b * double(top[4]) + c * double(bottom[1]) + d * double(bottom[4]),
        a * double(top[2]) + b * double(top[5]) + c * double(bottom[2]) + d * double(bottom[5])};
  }
  Vec3d sum;
  double total = 0;
  for (int k = 0; k < 4; ++k) {
    int i = x + (k & 1), j = y + (k >> 1);
    const double weight = ((k & 1) != 0 ? fx : 1 - fx) * ((k >> 1) != 0 ? fy : 1 - fy);
    if (weight <= 0 || !continue_texel(layout, place.chart, &i, &j)) continue;
    sum += to_double(image.rgb(i, j)) * weight;
    total += weight;
  }
  return total > 0 ? sum / total : nearest_radiance(layout, image, place);
}

// A place at another radius of the disc, on the same diameter.
MapPlace at_radius(const MapLayout& layout, const MapPlace& place, double scale) {
  const double half = 0.5 * layout.width;
  return {half + scale * (place.x - half), half + scale * (place.y - half), place.chart};
}

}  // namespace

void find_value(const MapLayout& layout, int* x, int* y) {
  if (!is_radial(layout.kind)) return;
  MapPlace place{*x + 0.5, *y + 0.5};
  while (!texel_has_direction(layout, *x, *y)) {
    const double radius = std::hypot(place.x - 0.5 * layout.width, place.y - 0.5 * layout.width);
    place = at_radius(layout, place, 1 - 0.75 / radius);
    *x = std::clamp(static_cast<int>(place.x), 0, layout.width - 1);
    *y = std::clamp(static_cast<int>(place.y), 0, layout.height - 1);
  }
}

Vec3d nearest_radiance(const MapLayout& layout, const Image& image, const MapPlace& place) {
  int x = std::clamp(static_cast<int>(place.x), 0, layout.width - 1);
  int y = std::clamp(static_cast<int>(place.y), 0, layout.height - 1);
  find_value(layout, &x, &y);
  return to_double(image.rgb(x, y));
}

namespace {

Vec3d interpolate(const MapLayout& layout, const Image& image, const MapPlace& place,
                  const RowBlend* blend) {
  if (!is_radial(layout.kind)) return bilinear(layout, image, place, blend);
  const double half = 0.5 * layout.width;
  const double radius = std::hypot(place.x - half, place.y - half);
  // Nearer to the rim than half a texel's diagonal the four samples around a place may all lie
  // outside; further in one of them has a quarter of the weight.
  const double inner_radius = std::max(0.0, half - 0.7072);
  if (radius <= std::min(inner_radius, half - 1)) return bilinear(layout, image, place, blend);
  const auto at = [&](double scale) {
    return bilinear(layout, image, at_radius(layout, place, scale), blend);
  };
  const Vec3d inner = at(std::min(radius, inner_radius) / radius);
  if (radial_limit(layout) < kPi) return inner;
  // The whole rim is one direction: over the last texel the value goes over to the rim's mean.
  const double share = std::clamp(radius - (half - 1), 0.0, 1.0);
  if (share == 0) return inner;
  constexpr int kRimPlaces = 4;
  Vec3d rim;
  for (int k = 0; k < kRimPlaces; ++k) {
    const double angle = 2 * kPi * (k + 0.5) / kRimPlaces;
    rim += bilinear(layout, image,
                    {half + inner_radius * std::cos(angle), half + inner_radius * std::sin(angle)},
                    blend);
  }
  return inner * (1 - share) + rim * (share / kRimPlaces);
}

}  // namespace

Vec3d smooth_radiance(const MapLayout& layout, const Image& image, const MapPlace& place) {
  return interpolate(layout, image, place, nullptr);
}

Vec3d smooth_radiance(const MapLayout& layout, const Image& image, const MapPlace& place,
                      const RowBlend& blend) {
  return interpolate(layout, image, place, &blend);
}

RowBlend::RowBlend(const MapLayout& layout) {
  if (layout.kind != LayoutKind::latlong && layout.kind != LayoutKind::cylinder) return;
  for (int j = 0; j + 1 < layout.height; ++j) {
    const auto density = [&](double y) { return solid_angle_density(layout, 1, y); };
    between_.push_back((density(j + 1.5) - density(j + 0.5)) / (4 * density(j + 1)));
  }
}

}  // namespace lightkiln

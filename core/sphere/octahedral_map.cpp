#include "core/sphere/octahedral_map.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lightkiln {

namespace {

double signed_as(double value, double sign) {
  return sign < 0 ? -value : value;
}

}  // namespace

Vec3d octahedral_direction(double x, double y) {
  const double z = 1 - std::abs(x) - std::abs(y);
  if (z >= 0) return normalize(Vec3d{x, y, z});
  return normalize(Vec3d{signed_as(1 - std::abs(y), x), signed_as(1 - std::abs(x), y), z});
}

void octahedral_coordinates(const Vec3d& d, double* x, double* y) {
  const double sum = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  const double px = d.x / sum, py = d.y / sum;
  *x = d.z >= 0 ? px : signed_as(1 - std::abs(py), px);
  *y = d.z >= 0 ? py : signed_as(1 - std::abs(px), py);
}

// A face of the octahedron is P = (x, y, 1 - |x| - |y|) up to signs, with the area vector
// P_x cross P_y = (sgn x, sgn y, 1), and P . (sgn x, sgn y, 1) = 1: the solid angle of dx dy seen
// from the centre is dx dy / |P|^3.
double octahedral_density(double x, double y) {
  double ax = std::abs(x), ay = std::abs(y);
  const double z = 1 - ax - ay;
  if (z < 0) {
    std::swap(ax, ay);
    ax = 1 - ax;
    ay = 1 - ay;
  }
  const double square = ax * ax + ay * ay + z * z;
  return 1 / (square * std::sqrt(square));
}

namespace {

struct Point {
  double x, y;
};

// A. Van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", 1983.
double triangle_solid_angle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const double volume = std::abs(dot(a, cross(b - a, c - a)));
  return 2 * std::atan2(volume, 1 + dot(a, b) + dot(b, c) + dot(c, a));
}

// The part of a rectangle of the quadrant x, y >= 0 on one side of x + y = 1, as a fan of spherical
// triangles: inside one face of the octahedron straight lines are great circles.
double side_solid_angle(const std::array<Point, 4>& rectangle, bool upper) {
  std::array<Vec3d, 8> polygon;
  size_t count = 0;
  const auto height = [&](const Point& p) { return upper ? 1 - p.x - p.y : p.x + p.y - 1; };
  const auto push = [&](double x, double y) {
    const double z = 1 - x - y;
    polygon[count++] =
        normalize(upper ? Vec3d{x, y, std::max(z, 0.0)} : Vec3d{1 - y, 1 - x, std::min(z, 0.0)});
  };
  for (size_t i = 0; i < 4; ++i) {
    const Point a = rectangle[i], b = rectangle[(i + 1) % 4];
    const double ha = height(a), hb = height(b);
    if (ha >= 0) push(a.x, a.y);
    if ((ha > 0 && hb < 0) || (ha < 0 && hb > 0)) {
      const double t = ha / (ha - hb);
      push(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y));
    }
  }
  double sum = 0;
  for (size_t i = 2; i < count; ++i) {
    sum += triangle_solid_angle(polygon[0], polygon[i - 1], polygon[i]);
  }
  return sum;
}

double quadrant_solid_angle(double x0, double x1, double y0, double y1) {
  if (!(x0 < x1 && y0 < y1)) return 0;
  const std::array<Point, 4> rectangle = {{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}};
  return side_solid_angle(rectangle, true) + side_solid_angle(rectangle, false);
}

}  // namespace

double octahedral_solid_angle(double x0, double x1, double y0, double y1) {
  double sum = 0;
  for (const double sx : {-1.0, 1.0}) {
    const double a = std::max(0.0, std::min(sx * x0, sx * x1));
    const double b = std::max(sx * x0, sx * x1);
    for (const double sy : {-1.0, 1.0}) {
      const double c = std::max(0.0, std::min(sy * y0, sy * y1));
      const double d = std::max(sy * y0, sy * y1);
      sum += quadrant_solid_angle(a, b, c, d);
    }
  }
  return sum;
}

// In the quadrant x, y >= 0 of the upper half: radius r = x + y and angle phi = (pi/2) y / r, with
// z = 1 - r^2. Then d(omega) = dz dphi = 2 r dr (pi/2) d(y/r) = pi dx dy.
Vec3d equal_area_direction(double x, double y) {
  const double ax = std::abs(x), ay = std::abs(y);
  const double side = 1 - ax - ay;
  const double r = 1 - std::abs(side);
  const double phi = kPi / 4 * (r > 0 ? (ay - ax) / r + 1 : 1);
  const double across = r * std::sqrt(std::max(0.0, 2 - r * r));
  const double z = side < 0 ? r * r - 1 : 1 - r * r;
  return normalize(
      Vec3d{signed_as(across * std::cos(phi), x), signed_as(across * std::sin(phi), y), z});
}

void equal_area_coordinates(const Vec3d& d, double* x, double* y) {
  const double ax = std::abs(d.x), ay = std::abs(d.y), az = std::abs(d.z);
  // sqrt(1 - |z|) without its cancellation at the poles.
  const double r = std::sqrt((ax * ax + ay * ay) / (1 + az));
  const double part = ax == 0 && ay == 0 ? 0.5 : std::atan2(ay, ax) / (kPi / 2);
  double v = part * r, u = r - v;
  if (d.z < 0) {
    std::swap(u, v);
    u = 1 - u;
    v = 1 - v;
  }
  *x = signed_as(std::clamp(u, 0.0, 1.0), d.x);
  *y = signed_as(std::clamp(v, 0.0, 1.0), d.y);
}

int octahedral_corner(const Vec3d& d) {
  if (d.z >= 0) return 0;
  return 1 + (d.x < 0 ? 1 : 0) + (d.y < 0 ? 2 : 0);
}

}  // namespace lightkiln

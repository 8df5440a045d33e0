// Sources: P. Debevec, "Light Probe Image Gallery" (angular map); P. Debevec, "Rendering Synthetic
// Objects into Real Scenes", SIGGRAPH 1998 (mirror ball); J. H. Lambert, "Anmerkungen und Zusaetze
// zur Entwerfung der Land- und Himmelscharten", 1772 (equal-area projections).

#include "core/sphere/radial_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/sphere/quadrature.h"

namespace lightkiln {

namespace {

// A camera at distance d (radii of the ball) from its centre sees the outline at the angle beta off
// the axis, sin beta = 1/d. At radius r of the picture (a plane: rectilinear) the ray leaves at
// gamma, tan gamma = r tan beta, and meets the ball where, by the sine rule, the ray and the normal
// enclose i, sin i = d sin gamma. The normal leans i - gamma off the axis and the mirrored ray i
// more: theta = 2 i - gamma. At the outline theta = pi - beta. As d grows gamma vanishes and
// sin i = r: theta = 2 asin r.
double close_up_angle(double distance, double radius) {
  const double tan_beta = 1 / std::sqrt((distance - 1) * (distance + 1));
  const double gamma = std::atan(radius * tan_beta);
  return 2 * std::asin(std::min(1.0, distance * std::sin(gamma))) - gamma;
}

// Newton on f(i) = 2 i - asin(sin i / d) - theta; f' = 2 - cos i / sqrt(d^2 - sin^2 i) lies in
// (1, 2], and f'' >= 0 for i in [0, pi/2], so that it converges from above without overshoot.
double close_up_radius(double distance, double angle) {
  const double tan_beta = 1 / std::sqrt((distance - 1) * (distance + 1));
  double i = kPi / 2;
  for (int step = 0; step < 60; ++step) {
    const double sine = std::sin(i);
    const double slope = 2 - std::cos(i) / std::sqrt((distance - sine) * (distance + sine));
    const double change = (2 * i - std::asin(sine / distance) - angle) / slope;
    i -= change;
    if (std::abs(change) < 1e-15) break;
  }
  return std::tan(std::asin(std::sin(i) / distance)) / tan_beta;
}

// Two axes of the picture and the one it faces.
struct Frame {
  Vec3d right, up, axis;
};
Frame frame_of(const MapLayout& layout) {
  if (layout.kind == LayoutKind::hemisphere || layout.kind == LayoutKind::hemisphere_equal_area) {
    return {{-1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  }
  return {{layout.mirrored ? 1.0 : -1.0, 0, 0}, {0, 1, 0}, {0, 0, 1}};
}

}  // namespace

bool is_radial(LayoutKind kind) {
  return kind == LayoutKind::angular || kind == LayoutKind::mirror_ball ||
         kind == LayoutKind::hemisphere || kind == LayoutKind::hemisphere_equal_area;
}

double radial_angle(const MapLayout& layout, double radius) {
  switch (layout.kind) {
    case LayoutKind::angular:
      return kPi * radius;
    case LayoutKind::hemisphere:
      return kPi / 2 * radius;
    case LayoutKind::hemisphere_equal_area:
      return 2 * std::asin(radius * std::sqrt(0.5));
    default:
      break;
  }
  if (layout.camera_distance > 0) return close_up_angle(layout.camera_distance, radius);
  return 2 * std::asin(std::min(1.0, radius));
}

double radial_radius(const MapLayout& layout, double angle) {
  switch (layout.kind) {
    case LayoutKind::angular:
      return angle / kPi;
    case LayoutKind::hemisphere:
      return angle / (kPi / 2);
    case LayoutKind::hemisphere_equal_area:
      return std::sin(angle / 2) / std::sqrt(0.5);
    default:
      break;
  }
  if (layout.camera_distance == 0) return std::sin(angle / 2);
  if (angle > radial_limit(layout)) return 2;
  return std::min(1.0, close_up_radius(layout.camera_distance, angle));
}

double radial_limit(const MapLayout& layout) {
  switch (layout.kind) {
    case LayoutKind::hemisphere:
    case LayoutKind::hemisphere_equal_area:
      return kPi / 2;
    case LayoutKind::mirror_ball:
      return layout.camera_distance > 0 ? kPi - std::asin(1 / layout.camera_distance) : kPi;
    default:
      return kPi;
  }
}

// dA = r dr dphi and d(omega) = sin(theta) d(theta) dphi, so that the density is
// sin(theta) theta'(r) / r: pi^2 sin(pi r) / (pi r) for the angular map, a quarter of that form for
// its half, 4 for the ball (equal-area), 2 for Lambert's hemisphere.
double radial_density(const MapLayout& layout, double radius) {
  const auto sinc = [](double x) { return x < 1e-9 ? 1.0 : std::sin(x) / x; };
  switch (layout.kind) {
    case LayoutKind::angular:
      return kPi * kPi * sinc(kPi * radius);
    case LayoutKind::hemisphere:
      return kPi * kPi / 4 * sinc(kPi / 2 * radius);
    case LayoutKind::hemisphere_equal_area:
      return 2;
    default:
      break;
  }
  if (layout.camera_distance == 0) return 4;
  // theta = 2 i - gamma; di/dr = d cos(gamma) / cos(i) dgamma/dr and
  // dgamma/dr = tan(beta) cos^2(gamma).
  const double d = layout.camera_distance;
  const double tan_beta = 1 / std::sqrt((d - 1) * (d + 1));
  const double r = std::clamp(radius, 1e-6, 1 - 1e-12);
  const double gamma = std::atan(r * tan_beta), sine = d * std::sin(gamma);
  const double cosine = std::sqrt(std::max(1e-24, (1 - sine) * (1 + sine)));
  const double turn = tan_beta * std::cos(gamma) * std::cos(gamma);
  const double slope = (2 * d * std::cos(gamma) / cosine - 1) * turn;
  return std::sin(2 * std::asin(std::min(1.0, sine)) - gamma) * slope / r;
}

Vec3d radial_direction(const MapLayout& layout, double right, double up) {
  const Frame frame = frame_of(layout);
  const double radius = std::hypot(right, up);
  if (radius == 0) return frame.axis;
  const double angle = radial_angle(layout, radius);
  const double scale = std::sin(angle) / radius;
  return normalize(frame.right * (scale * right) + frame.up * (scale * up) +
                   frame.axis * std::cos(angle));
}

Vec3d radial_direction_at(const MapLayout& layout, double right, double up, double theta) {
  const Frame frame = frame_of(layout);
  const double across = std::sin(theta);
  return normalize(frame.right * (across * right) + frame.up * (across * up) +
                   frame.axis * std::cos(theta));
}

bool radial_coordinates(const MapLayout& layout, const Vec3d& direction, double* right,
                        double* up) {
  const Frame frame = frame_of(layout);
  const double a = dot(direction, frame.right), b = dot(direction, frame.up);
  const double across = std::hypot(a, b);
  const double angle = std::atan2(across, dot(direction, frame.axis));
  double radius = radial_radius(layout, angle);
  // The rim itself is covered; its angle has rounding.
  if (radius > 1 && angle <= radial_limit(layout) + 1e-15) radius = 1;
  if (radius > 1) return false;
  if (across > 0) {
    *right = radius * a / across;
    *up = radius * b / across;
  } else {
    *right = radius;  // the axis, or the rim's one direction
    *up = 0;
  }
  return true;
}

namespace {

// Solid angle is the outline integral of (1 - cos theta(r)) dphi. Along a straight piece at signed
// distance p from the centre, with t measured along it, dphi = p dt / r^2, so that the integrand is
// p h(r), h = (1 - cos theta)/r^2 = 2 sin^2(theta/2)/r^2, which is smooth at r = 0. A close-up ball
// has a square root at the rim: t = a + (b - a) s^2 (3 - 2 s) takes it out at both ends.
double chord_integral(const MapLayout& layout, double p, double a, double b) {
  if (a == b) return 0;
  static const GaussRule rule = gauss_legendre(16);
  double sum = 0;
  for (size_t k = 0; k < rule.nodes.size(); ++k) {
    const double s = 0.5 * (1 + rule.nodes[k]);
    const double t = a + (b - a) * s * s * (3 - 2 * s);
    const double radius = std::min(1.0, std::hypot(p, t));
    const double sine = std::sin(radial_angle(layout, radius) / 2);
    sum += rule.weights[k] * 3 * s * (1 - s) * 2 * sine * sine / (radius * radius);
  }
  return p * (b - a) * sum;
}

// One edge of a rectangle, from t = a up to t = b at signed distance p: the chord inside the disc,
// and where it runs outside, the rim between the angles of its ends, integral of p dt / (p^2 +
// t^2).
double clipped_edge(const MapLayout& layout, double p, double a, double b) {
  if (p == 0) return 0;
  const double sine = std::sin(radial_limit(layout) / 2);
  const auto rim = [&](double from, double to) {
    return from < to ? 2 * sine * sine * (std::atan(to / p) - std::atan(from / p)) : 0.0;
  };
  if (std::abs(p) >= 1) return rim(a, b);
  const double half = std::sqrt((1 - p) * (1 + p));
  const double low = std::clamp(a, -half, half), high = std::clamp(b, -half, half);
  return rim(a, std::min(b, low)) + chord_integral(layout, p, low, high) +
         rim(std::max(a, high), b);
}

}  // namespace

// Counter-clockwise: the edge at x1 runs up at distance x1, the one at y1 runs to the left at
// distance y1 with t = -x, and so on.
double radial_solid_angle(const MapLayout& layout, double x0, double x1, double y0, double y1) {
  const double nearest = std::hypot(std::max({x0, -x1, 0.0}), std::max({y0, -y1, 0.0}));
  if (nearest >= 1) return 0;
  return clipped_edge(layout, x1, y0, y1) + clipped_edge(layout, y1, -x1, -x0) +
         clipped_edge(layout, -x0, -y1, -y0) + clipped_edge(layout, -y0, x0, x1);
}

}  // namespace lightkiln

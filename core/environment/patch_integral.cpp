#include "core/environment/patch_integral.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/math.h"

namespace lightkiln {

const GaussRule& patch_rule(int points) {
  static const std::array<GaussRule, 8> rules = [] {
    std::array<GaussRule, 8> all;
    for (int n = 1; n < 8; ++n) all[static_cast<size_t>(n)] = gauss_legendre(n);
    return all;
  }();
  return rules[static_cast<size_t>(points)];
}

PatchIntegral::PatchIntegral(const TwinLobe& lobe, double axis_colatitude_rad)
    : lobe_(lobe),
      empty_(lobe.empty_rad()),
      smallest_(lobe.width_rad(0) > 0 ? 0 : 1e-3),
      axis_(axis_colatitude_rad),
      sine_(std::sin(axis_)),
      cosine_(std::cos(axis_)) {}

// 1 - cos(angle) = (1 - cos(t - u)) + sin t sin u (1 - cos f) between colatitudes t and u at
// longitudes apart by f, in which nothing cancels.
double PatchIntegral::beside(double colatitude, double longitude) const {
  const double s = std::sin(0.5 * (colatitude - axis_)), f = std::sin(0.5 * longitude);
  return 2 * s * s + 2 * std::sin(colatitude) * sine_ * f * f;
}

// What lies beyond the meridian opposite the axis is turned to its other side.
double PatchIntegral::operator()(const Patch& patch, int horizon_points) const {
  const auto integral = [&](double left, double right) {
    const Patch part{patch.top, patch.bottom, left, right};
    const double side = std::max(part.bottom - part.top, part.right - part.left);
    return horizon_points > 0 ? clipped(part, horizon_points) : refined(part, smallest_ * side);
  };
  if (patch.left < -kPi) return integral(patch.left + 2 * kPi, kPi) + integral(-kPi, patch.right);
  if (patch.right > kPi) return integral(patch.left, kPi) + integral(-kPi, patch.right - 2 * kPi);
  return integral(patch.left, patch.right);
}

// Halves the patch until a rule fits. A lobe without a width at its axis vanishes there at least as
// fast as the distance: of a patch a thousandth as wide, a billionth of the whole hangs on it, and
// it is not halved again.
double PatchIntegral::refined(const Patch& patch, double smallest) const {
  constexpr double kLargest = 0.5;  // of what the sphere itself bends
  const double height = patch.bottom - patch.top, span = patch.right - patch.left;
  const double ring = patch.top < kPi / 2 && patch.bottom > kPi / 2
                          ? 1.0
                          : std::max(std::sin(patch.top), std::sin(patch.bottom));
  const double width = span * ring, size = std::max(height, width);
  const double middle =
      2 * std::asin(std::sqrt(std::min(1.0, 0.5 * beside(0.5 * (patch.top + patch.bottom),
                                                         0.5 * (patch.left + patch.right)))));
  const double reach = 0.5 * (height + width);
  if (lobe_.has_horizon() && middle - reach >= kPi / 2) return 0;
  if (middle + reach <= empty_) return 0;
  const double room = lobe_.width_rad(std::max(0.0, middle - reach));
  int points = 0;
  for (const PatchRule& rule : kPatchRules) {
    if (points == 0 && rule.shares * size <= room && size <= kLargest) points = rule.points;
  }
  if (points == 0 && size > smallest) {
    Patch first = patch, second = patch;
    if (width > height)
      first.right = second.left = 0.5 * (patch.left + patch.right);
    else
      first.bottom = second.top = 0.5 * (patch.top + patch.bottom);
    return refined(first, smallest) + refined(second, smallest);
  }
  if (points == 0) points = kPatchRules.back().points;
  return lobe_.has_horizon() && middle + reach > kPi / 2 ? clipped(patch, std::max(points, 3))
                                                         : plain(patch, points);
}

// One point more down than across: sin t adds to what changes there, most of all near a pole.
double PatchIntegral::plain(const Patch& patch, int points) const {
  const GaussRule &across = patch_rule(points), &down = patch_rule(points + 1);
  const double span = 0.5 * (patch.right - patch.left), height = 0.5 * (patch.bottom - patch.top);
  std::array<double, 8> places{};
  for (size_t i = 0; i < across.nodes.size(); ++i) {
    const double s = std::sin(0.5 * (patch.left + span * (1 + across.nodes[i])));
    places[i] = 2 * s * s;
  }
  double sum = 0;
  for (size_t j = 0; j < down.nodes.size(); ++j) {
    const double t = patch.top + height * (1 + down.nodes[j]), sine = std::sin(t);
    const double s = std::sin(0.5 * (t - axis_));
    std::array<double, 8> values{};
    lobe_.add(2 * s * s, sine * sine_, 1, {places.data(), across.nodes.size()}, values.data());
    double line = 0;
    for (size_t i = 0; i < across.nodes.size(); ++i) line += across.weights[i] * values[i];
    sum += down.weights[j] * sine * line;
  }
  return sum * span * height;
}

// cos t cos u + sin t sin u cos f = 0.
double PatchIntegral::horizon_longitude(double colatitude_rad) const {
  const double up = -std::cos(colatitude_rad) * cosine_, out = std::sin(colatitude_rad) * sine_;
  if (up >= out) return up > out ? 0 : kPi / 2;
  return up <= -out ? kPi : std::acos(up / out);
}

// In front of the axis is cosine_ cos t + b sin t >= 0, b = sine_ cos f: up to or from the angle
// atan2(|cosine_|, -b sign cosine_).
PatchIntegral::Stretch PatchIntegral::meridian_above(const Patch& patch, double longitude) const {
  const double b = sine_ * std::cos(longitude);
  if (cosine_ > 0) return {patch.top, std::clamp(std::atan2(cosine_, -b), patch.top, patch.bottom)};
  if (cosine_ < 0)
    return {std::clamp(std::atan2(-cosine_, b), patch.top, patch.bottom), patch.bottom};
  return {patch.top, b > 0 ? patch.bottom : patch.top};
}

PatchIntegral::Stretch PatchIntegral::parallel_above(const Patch& patch, double colatitude) const {
  const double half = horizon_longitude(colatitude);
  return {std::clamp(-half, patch.left, patch.right), std::clamp(half, patch.left, patch.right)};
}

namespace {

// A turn by x radians; a small one by its series, to the last digit but one.
struct Turn {
  explicit Turn(double x) {
    if (std::abs(x) > 0.25) {
      sine = std::sin(x);
      cosine = std::cos(x);
      return;
    }
    const double x2 = x * x;
    sine = x * (1 - x2 / 6 * (1 - x2 / 20 * (1 - x2 / 42 * (1 - x2 / 72 * (1 - x2 / 110)))));
    cosine = 1 - x2 / 2 * (1 - x2 / 12 * (1 - x2 / 30 * (1 - x2 / 56 * (1 - x2 / 90))));
  }
  double sine, cosine;
};

}  // namespace

// Far from the axis, so that the cosine of the angle to it loses nothing.
double PatchIntegral::along_meridian(const Stretch& above, double longitude,
                                     const GaussRule& rule) const {
  const double middle = 0.5 * (above.from + above.to), length = 0.5 * (above.to - above.from);
  const double s = std::sin(middle), c = std::cos(middle), out = sine_ * std::cos(longitude);
  double sum = 0;
  for (size_t i = 0; i < rule.nodes.size(); ++i) {
    const Turn turn(length * rule.nodes[i]);
    const double sine = s * turn.cosine + c * turn.sine, cosine = c * turn.cosine - s * turn.sine;
    sum += rule.weights[i] * sine * lobe_.at(1 - (cosine_ * cosine + out * sine));
  }
  return sum * length;
}

double PatchIntegral::along_parallel(const Stretch& above, double colatitude,
                                     const GaussRule& rule) const {
  const double middle = 0.5 * (above.from + above.to), length = 0.5 * (above.to - above.from);
  const double s = std::sin(middle), c = std::cos(middle), sine = std::sin(colatitude);
  const double up = cosine_ * std::cos(colatitude), out = sine_ * sine;
  double sum = 0;
  for (size_t i = 0; i < rule.nodes.size(); ++i) {
    const Turn turn(length * rule.nodes[i]);
    sum += rule.weights[i] * lobe_.at(1 - (up + out * (c * turn.cosine - s * turn.sine)));
  }
  return sum * length * sine;
}

// The lobe is cut along the direction in which the horizon is crossed the faster; the other one is
// cut where the horizon enters and leaves through the sides, and where it turns. Between those all
// is smooth.
double PatchIntegral::clipped(const Patch& patch, int points) const {
  const double t = 0.5 * (patch.top + patch.bottom), f = 0.5 * (patch.left + patch.right);
  const double by_colatitude = std::cos(t) * sine_ * std::cos(f) - std::sin(t) * cosine_;
  const double by_longitude = std::sin(t) * sine_ * std::sin(f);
  const bool down = std::abs(by_colatitude) * (patch.bottom - patch.top) >=
                    std::abs(by_longitude) * (patch.right - patch.left);
  std::array<double, 8> cuts;
  size_t count = 0;
  const double begin = down ? patch.left : patch.top, end = down ? patch.right : patch.bottom;
  const auto cut_at = [&](double place) {
    if (place <= begin || place >= end) return;
    size_t at = count++;
    for (; at > 0 && cuts[at - 1] > place; --at) cuts[at] = cuts[at - 1];
    cuts[at] = place;
  };
  if (down) {
    for (const double side : {patch.top, patch.bottom}) {
      const double place = horizon_longitude(side);
      cut_at(place);
      cut_at(-place);
    }
  } else {
    for (const double side : {patch.left, patch.right}) {
      const Stretch all = meridian_above({0, kPi, 0, 0}, side);
      cut_at(cosine_ > 0 ? all.to : all.from);
    }
    cut_at(std::abs(kPi / 2 - axis_));
    cut_at(kPi - std::abs(kPi / 2 - axis_));
  }
  const GaussRule& rule = patch_rule(points);
  double sum = 0;
  for (size_t piece = 0; piece <= count; ++piece) {
    const double from = piece > 0 ? cuts[piece - 1] : begin;
    const double half = 0.5 * ((piece < count ? cuts[piece] : end) - from);
    for (size_t j = 0; j < rule.nodes.size() && half > 0; ++j) {
      const double at = from + half * (1 + rule.nodes[j]);
      const Stretch above = down ? meridian_above(patch, at) : parallel_above(patch, at);
      if (above.to <= above.from) continue;
      sum += rule.weights[j] * half *
             (down ? along_meridian(above, at, rule) : along_parallel(above, at, rule));
    }
  }
  return sum;
}

}  // namespace lightkiln

// Source: Ewald, "Die Berechnung optischer und elektrostatischer Gitterpotentiale", 1921 (a slowly
// decaying kernel as a local part plus a band-limited one).

#include "core/environment/near_field.h"

#include <algorithm>
#include <cmath>

#include "core/base/instruction_sets.h"
#include "core/environment/vector_math.h"
#include "core/sphere/quadrature.h"

namespace lightkiln {

namespace {

const GaussRule& rule_of(int points) {
  static const std::array<GaussRule, 9> rules = [] {
    std::array<GaussRule, 9> all;
    for (int n = 1; n <= 8; ++n) all[static_cast<size_t>(n)] = gauss_legendre(n);
    return all;
  }();
  return rules[static_cast<size_t>(points)];
}

// n Gauss points on [-1, 1] miss the mean of x^2n by m_n = 4^n n!^4 / ((2n)!^2 (2n + 1)), the mean
// square of the monic Legendre polynomial. A side of extent s sees the lobe as (rho^2 + x^2)^-2,
// rho being the distance to its nearest complex pole; with the Taylor coefficient (n + 1) rho^-2n
// and two sides the relative error is at most 4 (n + 1) m_n (s / 2 rho)^2n, twice the leading term.
double widest_extent(int points, double tolerance) {
  double miss = 1;
  for (int n = 1; n <= points; ++n) {
    const double m = n;
    miss *= 4 * m * m * m * m / ((2 * m) * (2 * m) * (2 * m - 1) * (2 * m - 1));
  }
  miss /= 2.0 * points + 1;
  return 2 * std::pow(tolerance / (4 * (points + 1) * miss), 0.5 / points);
}

// Adds the core at 1 - cos(angle) = a + b x, times `weight` over the lobe's scale, for every point.
// The same bits with any vector width.
LIGHTKILN_CLONES void add_core(const GgxLobe& lobe, double split, double a, double b, double weight,
                               const std::vector<double>& points, std::vector<double>& values) {
  const double narrow = lobe.narrow(), broad = lobe.broad();
  const double* x = points.data();
  double* out = values.data();
  const size_t count = values.size();
  for (size_t i = 0; i < count; ++i) {
    const double one_minus = a + b * x[i];
    const double d = narrow + broad * one_minus;
    const double z = split * d;
    out[i] += weight * ((1 - one_minus) * (1 + z) * exp_minus(z) / (d * d));
  }
}

}  // namespace

double NearField::tolerance_at(double distance) const {
  const double growth = 1 + distance * distance / (4 * lobe_.narrow());
  return std::max(tolerance_, std::min(kWorstTolerance, tolerance_ * growth));
}

// The reach is where the core's share (1 + z) exp(-z) of the lobe falls to the tolerance.
NearField::NearField(const Image& latlong, double alpha, double split, double tolerance)
    : map_(latlong), lobe_(alpha), split_(split), tolerance_(tolerance), reach_(0) {
  for (double z = 1;; z += 0.125) {
    const double x = std::max(0.0, (z / split - lobe_.narrow()) / lobe_.broad());
    reach_ = 2 * std::asin(std::min(1.0, std::sqrt(x / 2)));
    if ((1 + z) * std::exp(-z) <= tolerance_at(reach_)) break;
  }
  for (int step = 0; step < kSteps; ++step) {
    const double distance = 2 * alpha * std::sqrt(std::ldexp(1.0, step) - 1);
    for (int n = 1; n <= kMostPoints; ++n) {
      widest_[static_cast<size_t>(step)][static_cast<size_t>(n)] =
          widest_extent(n, tolerance_at(distance));
    }
  }
}

// The pole of the lobe lies at angle 2 i alpha off the axis; the Gaussian is as smooth as a pole at
// three of its own scales. Pieces are laid from the near end outwards and so grow with distance.
void NearField::place_points(double from, double to, double scale, double sine,
                             std::vector<double>& nodes, std::vector<double>& weights) const {
  if (from < 0 && to > 0) {
    place_points(from, 0, scale, sine, nodes, weights);
    from = 0;
  }
  const double sign = to <= 0 ? -1 : 1, end = std::max(std::abs(from), std::abs(to));
  for (double begin = std::min(std::abs(from), std::abs(to)); begin < end;) {
    const double distance = sine < 0 ? begin : std::asin(sine * std::sin(std::min(begin, kPi / 2)));
    const double squared = 4 * lobe_.narrow() + distance * distance;
    const int step = std::ilogb(squared / (4 * lobe_.narrow()));
    const auto& widest = widest_[static_cast<size_t>(std::clamp(step, 0, kSteps - 1))];
    const double unit = std::min(std::sqrt(squared), 3 / std::sqrt(split_)) / scale;
    const double extent = std::min(end - begin, unit * widest[kMostPoints]);
    int points = 1;
    while (points < kMostPoints && extent > unit * widest[static_cast<size_t>(points)]) ++points;
    const GaussRule& rule = rule_of(points);
    for (size_t i = 0; i < rule.nodes.size(); ++i) {
      nodes.push_back(sign * (begin + 0.5 * extent * (1 + rule.nodes[i])));
      weights.push_back(0.5 * extent * rule.weights[i]);
    }
    begin = end - begin - extent > 1e-12 * end ? begin + extent : end;
  }
}

// Points of every column within reach, as 1 - cos(difference of longitude) and weight. A column is
// at least as far away as its meridian, and at most as wide as in the row nearest the equator.
void NearField::cut_columns(double theta, double phi, Workspace& work) const {
  const int width = map_.width;
  const double step = 2 * kPi / width, sine = std::sin(theta);
  const double top = std::max(theta - reach_, 0.0), bottom = std::min(theta + reach_, kPi);
  const bool over_pole = top == 0 || bottom == kPi;
  const double half = over_pole ? kPi : std::asin(std::min(1.0, std::sin(reach_) / sine));
  const double place = (kPi - phi) / step;  // of phi in columns
  int first = static_cast<int>(std::floor(place - half / step));
  int last = static_cast<int>(std::floor(place + half / step));
  if (last - first + 1 >= width) {
    first = static_cast<int>(std::floor(place)) - width / 2;
    last = first + width - 1;
  }
  const double scale = std::sin(std::clamp(kPi / 2, top, bottom));
  work.column_x.clear();
  work.column_weight.clear();
  work.column_first.clear();
  work.columns.clear();
  for (int column = first; column <= last; ++column) {
    work.columns.push_back(((column % width) + width) % width);
    work.column_first.push_back(work.column_x.size());
    place_points((column - place) * step, (column + 1 - place) * step, scale, sine, work.column_x,
                 work.column_weight);
  }
  work.column_first.push_back(work.column_x.size());
  for (double& x : work.column_x) {
    const double s = std::sin(0.5 * x);
    x = 2 * s * s;
  }
}

double NearField::typical_points() const {
  Workspace work;
  cut_columns(kPi / 2, 0, work);
  const double step = kPi / map_.height;
  for (double from = 0; from < reach_; from += step) {
    place_points(from, from + step, 1, -1, work.row_nodes, work.row_weights);
  }
  return 2 * static_cast<double>(work.row_nodes.size() * work.column_x.size());
}

// 1 - cos(angle) between colatitudes t and u at longitudes apart by f is
//   (1 - cos(t - u)) + sin t sin u (1 - cos f), in which nothing cancels.
Vec3d NearField::at(const Vec3d& direction, Workspace& work) const {
  const double theta = std::atan2(std::hypot(direction.x, direction.z), direction.y);
  const double phi = std::atan2(direction.x, direction.z);
  const double step = kPi / map_.height, sine = std::sin(theta);
  cut_columns(theta, phi, work);
  const int first = std::max(0, static_cast<int>(std::floor((theta - reach_) / step)));
  const int last = std::min(map_.height - 1, static_cast<int>(std::floor((theta + reach_) / step)));
  Vec3d sum;
  for (int row = first; row <= last; ++row) {
    work.row_nodes.clear();
    work.row_weights.clear();
    place_points(row * step - theta, (row + 1) * step - theta, 1, -1, work.row_nodes,
                 work.row_weights);
    work.values.assign(work.column_x.size(), 0.0);
    for (size_t j = 0; j < work.row_nodes.size(); ++j) {
      const double turn = work.row_nodes[j], s = std::sin(0.5 * turn);
      const double row_sine = std::sin(theta + turn);
      add_core(lobe_, split_, 2 * s * s, sine * row_sine, work.row_weights[j] * row_sine,
               work.column_x, work.values);
    }
    Vec3d line;
    for (size_t c = 0; c < work.columns.size(); ++c) {
      double share = 0;
      for (size_t i = work.column_first[c]; i < work.column_first[c + 1]; ++i) {
        share += work.values[i] * work.column_weight[i];
      }
      line += to_double(map_.rgb(work.columns[c], row)) * share;
    }
    sum += line;
  }
  return sum * lobe_.scale();
}

}  // namespace lightkiln

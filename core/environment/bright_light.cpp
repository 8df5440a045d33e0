#include "core/environment/bright_light.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/instruction_sets.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/harmonics.h"

namespace lightkiln {

namespace {

// The angle between unit vectors with cosine c, to 2e-8: Abramowitz & Stegun 4.4.46,
// acos(x) = sqrt(1 - x) poly(x), mirrored for negative x.
double fast_acos(double c) {
  const double magnitude = std::abs(c), x = magnitude < 1 ? magnitude : 1;
  double p = -0.0012624911;
  p = p * x + 0.0066700901;
  p = p * x - 0.0170881256;
  p = p * x + 0.0308918810;
  p = p * x - 0.0501743046;
  p = p * x + 0.0889789874;
  p = p * x - 0.2145988016;
  p = p * x + 1.5707963050;
  const double angle = std::sqrt(1 - x) * p;
  return c < 0 ? kPi - angle : angle;
}

// Cosines of the angles between a direction and `count` others, and the angles times `scale`. The
// same bits with any vector width.
LIGHTKILN_CLONES void find_places(const Vec3d& direction, const double* x, const double* y,
                                  const double* z, double scale, double* cosines, double* places,
                                  size_t count) {
  for (size_t i = 0; i < count; ++i) {
    cosines[i] = x[i] * direction.x + y[i] * direction.y + z[i] * direction.z;
    places[i] = fast_acos(cosines[i]) * scale;
  }
}

// Between steps the table is read linearly, of which a wave of band l loses (l step)^2 / 8, and so
// it is integrated over cells, at (l step)^2 / 12. What few bands leave holds many: it counts as
// that of sixteen at least.
constexpr int kTableStepsPerBand = 128;
constexpr int kSumStepsPerBand = 8;
int table_bands(int bands) {
  return std::max(16, bands);
}

// What the band limit cuts off the lobe, but for its kink: K(t) - slope max(cos t, 0) -
// sum_{l<L} (2l+1)/(4 pi) h_l P_l(cos t), at equal steps of the angle from 0 to pi. The sum is
// smooth: it is evaluated at every sixteenth step, even in t about both ends, and interpolated
// between by the polynomial through eight of those, which loses 4e-7 of band L (0.27 (pi / 16)^8 at
// phase pi / 8).
std::vector<double> cut_table(const ZonalKernel& kernel, const std::vector<double>& responses) {
  constexpr int kFine = kTableStepsPerBand / kSumStepsPerBand, kTaps = 8;
  const int bands = static_cast<int>(responses.size());
  const int coarse = kSumStepsPerBand * table_bands(bands), steps = kFine * coarse;
  std::vector<double> sums(static_cast<size_t>(coarse) + 1);
  for (int i = 0; i <= coarse; ++i) {
    const double z = std::cos(kPi * i / coarse);
    double before = 0, value = 1, sum = 0;
    for (size_t l = 0; l < responses.size(); ++l) {
      const double degree = static_cast<double>(l);
      if (l > 0) {
        const double next = ((2 * degree - 1) * z * value - (degree - 1) * before) / degree;
        before = value;
        value = next;
      }
      sum += (2 * degree + 1) / (4 * kPi) * responses[l] * value;
    }
    sums[static_cast<size_t>(i)] = sum;
  }
  const double slope = kernel.horizon_slope();
  double weights[kFine][kTaps];
  for (int part = 0; part < kFine; ++part) {
    for (int i = 0; i < kTaps; ++i) {
      double weight = 1;
      for (int j = 0; j < kTaps; ++j) {
        if (j != i) weight *= (double(part) / kFine - (j - 3)) / (i - j);
      }
      weights[part][i] = weight;
    }
  }
  const auto sum_at = [&](int i) {
    const int mirrored = i < 0 ? -i : i > coarse ? 2 * coarse - i : i;
    return sums[static_cast<size_t>(mirrored)];
  };
  std::vector<double> table(static_cast<size_t>(steps) + 2);
  for (int i = 0; i <= steps; ++i) {
    double sum = 0;
    for (int k = 0; k < kTaps; ++k) sum += weights[i % kFine][k] * sum_at(i / kFine + k - 3);
    const double angle = kPi * i / steps;
    table[static_cast<size_t>(i)] =
        kernel.at_angle(angle) - slope * std::max(0.0, std::cos(angle)) - sum;
  }
  table.back() = table[static_cast<size_t>(steps)];
  return table;
}

// The mean of the table over a square cell of side `extent` about each of its angles. A square has
// the same second moment extent^2 / 12 in every direction: along the angle the mean over an
// interval of that length, and across it extent^2 / 24 cot(t) K'(t).
std::vector<double> cell_means(const std::vector<double>& table, double extent) {
  const int steps = static_cast<int>(table.size()) - 2;
  const double step = kPi / steps, half = 0.5 * extent / step;
  const auto at = [&](int i) {
    const int mirrored = i < 0 ? -i : i > steps ? 2 * steps - i : i;
    return table[static_cast<size_t>(mirrored)];
  };
  // sums[i + margin]: the integral of the interpolated table up to point i, in steps.
  const int margin = static_cast<int>(std::ceil(half)) + 2;
  std::vector<double> sums{0};
  for (int i = -margin; i < steps + margin; ++i)
    sums.push_back(sums.back() + 0.5 * (at(i) + at(i + 1)));
  const auto integral = [&](double place) {
    const int i = static_cast<int>(std::floor(place));
    const double f = place - i;
    return sums[static_cast<size_t>(i + margin)] + f * at(i) + 0.5 * f * f * (at(i + 1) - at(i));
  };
  std::vector<double> means = table;
  for (int i = 0; i <= steps; ++i) {
    const double slope = (at(i + 1) - at(i - 1)) / (2 * step), angle = step * i;
    const double bend = (at(i + 1) - 2 * at(i) + at(i - 1)) / (step * step);
    const bool pole = i == 0 || i == steps;  // where cot(t) K' tends to K''
    const double across = pole ? bend : slope / std::tan(angle);
    means[static_cast<size_t>(i)] =
        (integral(i + half) - integral(i - half)) / (2 * half) + extent * extent / 24 * across;
  }
  means.back() = means[static_cast<size_t>(steps)];
  return means;
}

// How a bright texel is cut: rows of colatitude, columns of longitude.
struct Cells {
  int rows = 1, columns = 1;
  double height = 0, width = 0;  // of a cell, radians along the sphere
};

// Of the three finest numbers of rows that are fine enough, the one whose cells are most nearly
// square.
Cells cells_of(const BrightTexel& texel, int bands, double phase) {
  const double side = texel.extent_rad, ring = std::hypot(texel.direction.x, texel.direction.z);
  const int fewest = std::max(1, static_cast<int>(std::ceil(side * bands / phase)));
  Cells best;
  double least = -1;
  for (int rows = fewest; rows < fewest + 3; ++rows) {
    const int columns = std::max(1, static_cast<int>(std::lround(rows * ring)));
    const Cells cells{rows, columns, side / rows, side * ring / columns};
    const double skew = std::abs(cells.height * cells.height - cells.width * cells.width);
    if (least >= 0 && skew >= 0.5 * least) continue;
    best = cells;
    least = skew;
  }
  return best;
}

// The cells of one row of a texel.
struct CellRow {
  double colatitude, share;  // of the cells' middles; of the texel's light
  double height, width;      // of a cell
  double side2() const { return (height * height + width * width) / 2; }
};
std::vector<CellRow> rows_of(const BrightTexel& texel, const Cells& cells) {
  double u = 0, v = 0;
  latlong_coordinates(texel.direction, &u, &v);
  std::vector<CellRow> rows;
  double all = 0;
  for (int j = 0; j < cells.rows; ++j) {
    const double t = kPi * v + cells.height * (j + 0.5 - 0.5 * cells.rows), sine = std::sin(t);
    rows.push_back({t, sine, cells.height, texel.extent_rad * sine / cells.columns});
    all += sine;
  }
  for (CellRow& row : rows) row.share /= all;
  return rows;
}

// The mean over all bright light of a cell's squared side.
double common_side2(const LightStatistics& light, int bands, double phase) {
  double sum = 0, all = 0;
  for (const BrightTexel& texel : light.bright) {
    const double energy = luminance(texel.energy);
    for (const CellRow& row : rows_of(texel, cells_of(texel, bands, phase)))
      sum += energy * row.share * row.side2();
    all += energy;
  }
  return sum / all;
}

constexpr int kUsualPoints = 384;
constexpr int kMostPoints = 2500;  // where fewer would miss the target

// The mean of max(c + x + y, 0) over |x| <= a, |y| <= b: the second differences of its fourfold
// antiderivative z^3 / 6, over the area 4 a b. Sides next to nothing are widened by a thousandth.
double kink_mean(double c, double a, double b) {
  a = std::max(a, 1e-3 * b);
  b = std::max(b, 1e-3 * a);
  const auto cube = [](double z) { return z > 0 ? z * z * z : 0.0; };
  return (cube(c + a + b) - cube(c + a - b) - cube(c - a + b) + cube(c - a - b)) / (24 * a * b);
}

}  // namespace

// Cells of equal steps of longitude and colatitude. The integral of the direction over one between
// colatitudes t and t + h and longitudes 2 f apart has the component
//   integral cos sin = sin(2t + h) sin(h) / 2  along the polar axis and
//   integral sin^2 times sin(f) / f = (h - cos(2t + h) sin(h)) / 2 sin(f) / f  across it,
// over a solid angle of 2 sin(t + h/2) sin(h/2) a radian of longitude: above the horizon a cosine's
// mean is that with the mean direction, which is a little shorter than 1.
CutLight::CutLight(const LightStatistics& light, const ZonalKernel& kernel,
                   const std::vector<double>& responses, double phase)
    : slope_(kernel.horizon_slope()) {
  const int bands = static_cast<int>(responses.size());
  for (const BrightTexel& texel : light.bright) {
    const Cells cells = cells_of(texel, bands, phase);
    double u = 0, v = 0;
    latlong_coordinates(texel.direction, &u, &v);
    const double du = texel.extent_rad / (2 * kPi) / cells.columns, half_turn = kPi * du;
    for (const CellRow& row : rows_of(texel, cells)) {
      const double twice = 2 * row.colatitude, h = row.height;
      const double along = 0.5 * std::sin(twice) * std::sin(h);
      const double out =
          0.5 * (h - std::cos(twice) * std::sin(h)) * std::sin(half_turn) / half_turn;
      const double centre = std::atan2(out, along) / kPi;
      const double shrink =
          std::hypot(out, along) / (2 * std::sin(row.colatitude) * std::sin(0.5 * h));
      for (int i = 0; i < cells.columns; ++i) {
        const Vec3d at = latlong_direction(u + du * (i + 0.5 - 0.5 * cells.columns), centre);
        const double half_width = 0.5 * row.width, half_height = 0.5 * h;
        const Vec3d across = normalize(Vec3d{at.z, 0, -at.x});
        x_.push_back(at.x);
        y_.push_back(at.y);
        z_.push_back(at.z);
        cells_.push_back({texel.energy * (row.share / cells.columns), across * half_width,
                          cross(across, at) * half_height, half_width + half_height, shrink});
      }
    }
  }
  table_ = cell_means(cut_table(kernel, responses), std::sqrt(common_side2(light, bands, phase)));
}

int cut_light_points(const LightStatistics& light, int bands, double phase) {
  int points = 0;
  for (const BrightTexel& texel : light.bright) {
    const Cells cells = cells_of(texel, bands, phase);
    points += cells.rows * cells.columns;
  }
  return points;
}

// In blocks of points, whose angles are found side by side.
Vec3d CutLight::at(const Vec3d& direction) const {
  constexpr size_t kBlock = 128;
  const double scale = static_cast<double>(table_.size() - 2) / kPi;
  std::array<double, kBlock> cosines, places;
  Vec3d sum;
  for (size_t first = 0; first < cells_.size(); first += kBlock) {
    const size_t count = std::min(kBlock, cells_.size() - first);
    find_places(direction, &x_[first], &y_[first], &z_[first], scale, cosines.data(), places.data(),
                count);
    for (size_t i = 0; i < count; ++i) {
      const Cell& cell = cells_[first + i];
      const size_t index = static_cast<size_t>(places[i]);
      const double f = places[i] - static_cast<double>(index);
      const double kink = std::abs(cosines[i]) < cell.reach
                              ? kink_mean(cosines[i], std::abs(dot(cell.across, direction)),
                                          std::abs(dot(cell.down, direction)))
                              : std::max(cosines[i], 0.0);
      sum += cell.energy *
             (table_[index] * (1 - f) + table_[index + 1] * f + slope_ * cell.shrink * kink);
    }
  }
  return sum;
}

// A cell a by b against a wave of band l that crosses it at an angle p to its side a has the factor
// sinc(l a cos p / 2) sinc(l b sin p / 2), where the table has sinc(l s / 2):
//   1 - l^2 (a^2 cos^2 p + b^2 sin^2 p) / 24 + ...  against  1 - l^2 s^2 / 24 + ...
// The second-order terms differ by at most l^2 (|(a^2 + b^2) / 2 - s^2| + |a^2 - b^2| / 2) / 24,
// the fourth-order ones by at most (l max(a, b))^4 / 2560 (at b = 0; 1 / 5760 for a square), and
// both factors lie between -0.22 and 1; to these comes what the table's steps lose. Taken as if all
// bright light E were one source, whose squared norm in band l is E^2 (2l+1) / (4 pi).
//
// At colatitude t a cell is not quite a rectangle: with k = cot t its sides are k of themselves a
// radian longer towards the equator, and its parallels bend by k. Next to a pole it is a triangle,
// k a = 2. About the centre of mass the density (1 + k y) / a has the variance a^2 (1 - (k a)^2 /
// 12) / 12 and the third cumulant -k a^4 / 120, which a wave sees as l^2 (k a)^2 a^2 / 288 and l^3
// k a^4 / 720; the bent parallels add l^3 k b^4 / 1900 at the most. Of a kink that crosses the cell
// the mean moves by at most slope k a^2 / 120, and by slope k b^2 / 120 for the parallels; it does
// so where |cos| is under (a + b) / 2, a share of as much of the sphere.
//
// The kernel is slope max(c, 0), whose bands are slope A_l and whose mean over a rectangle is
// exact, and a rest of bands h_l - slope A_l, which falls as l^-3.5. The table holds all bands of
// the rest beyond the limit and, negative, the kink's below it. Past the computed bands every other
// one is left; past sixteen times as many, the sum is an integral.
double cut_light_bound(const LightStatistics& light, const ZonalKernel& kernel,
                       const std::vector<double>& responses, int bands, double phase) {
  const double side2 = common_side2(light, bands, phase);
  double second = 0, third = 0, fourth = 0, bent = 0, all = 0;
  for (const BrightTexel& texel : light.bright) {
    for (const CellRow& row : rows_of(texel, cells_of(texel, bands, phase))) {
      const double energy = luminance(texel.energy) * row.share;
      const double a2 = row.height * row.height, b2 = row.width * row.width;
      const double side = std::max(row.height, row.width);
      const double bend = std::min(2.0, side / std::abs(std::tan(row.colatitude)));
      second += energy * (std::abs(row.side2() - side2) + std::abs(a2 - b2) / 2) / 24 +
                energy * bend * bend * side * side / 288;
      third += energy * bend * side * side * side / 500;
      fourth += energy * std::max(a2, b2) * std::max(a2, b2) / 2560;
      bent += energy * bend * side * std::sqrt(std::min(1.0, 0.5 * (row.height + row.width))) / 60;
      all += energy;
    }
  }
  const double step = kPi / (kTableStepsPerBand * table_bands(bands));
  second = second / all + step * step * (1.0 / 8 + 1.0 / 12);
  third /= all;
  fourth /= all;
  const auto term = [&](double l, double response) {
    const double l2 = l * l, part = l2 * (second + l * third + l2 * fourth);
    const double miss = std::min(1.22, part) * response;
    return (2 * l + 1) * miss * miss;
  };
  double sum = 0, last = 0;
  for (size_t l = 1; l < responses.size(); ++l) {
    const double kink = kernel.horizon_slope() * clamped_cosine_band(static_cast<int>(l));
    const bool below = l < static_cast<size_t>(bands);
    sum += term(static_cast<double>(l), below ? kink : responses[l] - kink);
    if (l + 2 >= responses.size()) last = std::max(last, std::abs(responses[l] - kink));
  }
  const double count = static_cast<double>(responses.size());
  double l = count;
  for (; l < 16 * count; l += 2) sum += term(l, last * std::pow(l / count, -3.5));
  sum += 1.5 * last * last * std::pow(l / count, -7) * l * l / 5;
  // Errors count by the channel that errs the most, against the mean of all.
  Vec3d energy;
  for (const BrightTexel& texel : light.bright) energy += texel.energy;
  const double share = std::max({energy.x, energy.y, energy.z}) / (4 * kPi * light.mean_luminance);
  return share * (std::sqrt(sum) + 4 * kPi * kernel.horizon_slope() * bent / all);
}

double cut_light_phase(const LightStatistics& light, const ZonalKernel& kernel,
                       const std::vector<double>& responses, int bands, double allowance) {
  double best = 0, least = -1;
  for (const double phase :
       {64.0, 32.0, 16.0, 8.0, 4.0, 2.8, 2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25}) {
    const int most = least <= 1 / kPhaseShare * allowance ? kUsualPoints : kMostPoints;
    if (least >= 0 && cut_light_points(light, bands, phase) > most) break;
    const double bound = cut_light_bound(light, kernel, responses, bands, phase);
    if (least >= 0 && bound >= least) continue;
    best = phase;
    least = bound;
    if (bound <= allowance) break;
  }
  return best;
}

}  // namespace lightkiln

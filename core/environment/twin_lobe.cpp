#include "core/environment/twin_lobe.h"

#include <algorithm>
#include <cmath>

#include "core/base/instruction_sets.h"
#include "core/base/math.h"
#include "core/environment/charlie_lobe.h"
#include "core/environment/ggx_lobe.h"
#include "core/environment/vector_math.h"

namespace lightkiln {

double TwinLobe::at(double beside) const {
  const double place = 0;
  double value = 0;
  add(beside, 0, 1, {&place, 1}, &value);
  return value;
}

namespace {

LIGHTKILN_CLONES void add_ggx(double narrow, double broad, double from, double along, double weight,
                              const double* places, double* values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    const double beside = from + along * places[i];
    const double d = narrow + broad * beside;
    values[i] += weight * (1 - beside) / (d * d);
  }
}

LIGHTKILN_CLONES void add_charlie(double power, double from, double along, double weight,
                                  const double* places, double* values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    const double beside = from + along * places[i];
    values[i] += weight * (1 - beside) * positive_power(beside, power);
  }
}

// 1 / d^2 with d = alpha^2 + (1 - alpha^2) sin^2(t / 2) has its poles at angles of about 2 i alpha,
// and never farther than at 2 sqrt(d) from an angle t.
class TwinGgx final : public TwinLobe {
 public:
  explicit TwinGgx(double alpha) : lobe_(alpha) {}
  void add(double from, double along, double weight, std::span<const double> places,
           double* values) const override {
    add_ggx(lobe_.narrow(), lobe_.broad(), from, along, weight * lobe_.scale(), places.data(),
            values, places.size());
  }
  double width_rad(double angle_rad) const override {
    const double s = std::sin(angle_rad / 2);
    return 2 * std::sqrt(lobe_.narrow() + 2 * lobe_.broad() * s * s);
  }

 private:
  GgxLobe lobe_;
};

// c (1 - c)^p grows with the angle t like t^2p, whose 2n-th derivative is at most (2p / t)^2n of
// it. What rules allow for derivatives is that of a pole: 5.3 times as much a step.
class TwinCharlie final : public TwinLobe {
 public:
  explicit TwinCharlie(double alpha) : lobe_(alpha) {}
  void add(double from, double along, double weight, std::span<const double> places,
           double* values) const override {
    add_charlie(lobe_.power(), from, along, weight * lobe_.scale(), places.data(), values,
                places.size());
  }
  double width_rad(double angle_rad) const override {
    return angle_rad * std::min(1.0, 2.65 / lobe_.power());
  }
  // Where scale x^p is so little that even all directions would not hold more.
  double empty_rad() const override {
    const double x = std::pow(kTwinEmpty / (4 * kPi * lobe_.scale()), 1 / lobe_.power());
    return 2 * std::asin(std::sqrt(0.5 * std::min(x, 1.0)));
  }

 private:
  CharlieLobe lobe_;
};

}  // namespace

std::unique_ptr<TwinLobe> make_twin_lobe(const Lobe& lobe) {
  if (lobe.kind == LobeKind::charlie) return std::make_unique<TwinCharlie>(lobe.alpha);
  return std::make_unique<TwinGgx>(lobe.alpha);
}

}  // namespace lightkiln

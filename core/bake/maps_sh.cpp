// Coefficients of the radiance, windowed if ordered, with their smaller and their foreign forms.

#include "core/bake/maps_sh.h"

#include <algorithm>
#include <cmath>

#include "core/bake/window_report.h"
#include "core/base/parallel.h"
#include "core/environment/brute_force.h"
#include "core/sphere/harmonic_rotation.h"

namespace lightkiln {

namespace {

Vec3d coefficient_of(const LatlongSpectrum& spectrum, int l, int m) {
  const double* at = &spectrum.coefficients[spectrum.offset(l, std::abs(m))] + (m < 0 ? 3 : 0);
  return {at[0], at[1], at[2]};
}

}  // namespace

ShNeed coefficients_need(int bands, double target) {
  constexpr double kFinest = 1e-11;
  return {bands, std::max(kFinest, 0.01 * target)};
}

double coefficients_bound(const ShNeed& need, int height) {
  constexpr double kRounding = 1e-12;
  if (need.bands == 0) return 0;
  return row_band_error(row_points(height, {}, need), need.bands - 1, height) + kRounding;
}

// The turn into the world frame is a rotation, which tests hold to 1e-12; what is checked here is
// the projection.
MeasuredError check_coefficients(MapsLight& light, int bands, int count, Progress& progress) {
  if (light.constant()) return {};
  const LatlongSpectrum& spectrum = light.spectrum(progress);
  const auto place = [&](size_t i) {
    const size_t index = check_index(static_cast<int>(i), sh_coefficient_count(bands));
    const int l = static_cast<int>(std::sqrt(static_cast<double>(index)));
    return std::pair(l, static_cast<int>(index) - l * l - l);
  };
  std::vector<Vec3d> truths(static_cast<size_t>(count));
  parallel_blocks(
      truths.size(), 1, light.threads(), progress,
      [&](size_t i, size_t) {
        const auto [l, m] = place(i);
        truths[i] = projected_coefficient(light.environment(), l, m);
      },
      1, 1);
  ErrorMeter meter(length(coefficient_of(spectrum, 0, 0)));
  for (size_t i = 0; i < truths.size(); ++i) {
    const auto [l, m] = place(i);
    meter.add(coefficient_of(spectrum, l, m), truths[i]);
  }
  return meter.result();
}

ShRgb radiance_coefficients(MapsLight& light, int bands, Progress& progress) {
  if (!light.constant()) {
    const ShRgb sh = world_harmonics(light.spectrum(progress), bands);
    const Rotation& turn = light.environment().pending;
    return turn.is_identity() ? sh : sh_rotate(sh, turn.rows);
  }
  ShRgb sh(bands);
  sh.coefficients[0] = light.environment().mean * (2 * std::sqrt(kPi));
  return sh;
}

namespace {

void write_coefficients(const ShRgb& sh, ByteWriter& writer) {
  for (const Vec3d& c : sh.coefficients) {
    for (int channel = 0; channel < 3; ++channel) writer.f64(c[channel]);
  }
}

ShRgb read_coefficients(int bands, ByteReader& reader) {
  ShRgb sh(bands);
  for (Vec3d& c : sh.coefficients) {
    for (int channel = 0; channel < 3; ++channel) c[channel] = reader.f64();
  }
  return sh;
}

class Coefficients : public MapsOutput {
 public:
  Coefficients(const ShOutput& order, const MapsLight& light, double target)
      : order_(order), constant_(light.constant()) {
    if (constant_) return;
    need_ = coefficients_need(projected(), target);
    bound_ = coefficients_bound(need_, light.environment().radiance.height);
  }

  double error_bound() const override { return bound_; }
  SpectrumNeed spectrum_need() const override { return {need_, nullptr}; }
  double model_seconds(MapsLight&) const override {
    return constant_ ? 0 : window_seconds(order_.window, order_.bands);
  }

  // Bytes: the coefficients as ordered, the report of a window, the raw bands of ZH3.
  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    const ShRgb raw = radiance_coefficients(light, projected(), progress);
    ShRgb kept(order_.bands);
    std::copy_n(raw.coefficients.begin(), kept.coefficients.size(), kept.coefficients.begin());
    const WindowedSh windowed =
        window_sh(kept, order_.window, order_.window_quantity, light.threads(), progress);
    write_coefficients(windowed.sh, writer);
    if (order_.window != ShWindow::none) write_window_report(windowed.report, writer);
    if (order_.zh3) write_coefficients(raw_three(raw), writer);
    return check_coefficients(light, order_.bands, check_texels, progress);
  }

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    ShDocument sh;
    sh.sh = read_coefficients(order_.bands, reader);
    sh.selftest = make_selftest(sh.sh);
    sh.error = error_bound();
    if (order_.window != ShWindow::none) {
      result->document.sh_window =
          read_window_report(order_.window, order_.window_quantity, order_.bands, reader);
    }
    if (order_.zh3) result->document.zh3 = make_zh3(read_coefficients(3, reader));
    for (size_t i = 0; i < std::size(kShTargets); ++i) {
      if (order_.exports >> i & 1)
        result->document.sh_exports.push_back(export_sh(sh.sh, kShTargets[i]));
    }
    result->document.sh = std::move(sh);
    result->document.sh_measured = measured;
  }

 private:
  int projected() const { return order_.zh3 ? std::max(order_.bands, 3) : order_.bands; }

  static ShRgb raw_three(const ShRgb& raw) {
    ShRgb three(3);
    std::copy_n(raw.coefficients.begin(), three.coefficients.size(), three.coefficients.begin());
    return three;
  }

  ShOutput order_;
  bool constant_;
  ShNeed need_;  // none of a constant map
  double bound_ = 0;
};

void order_sh(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
              MapsOutputs* outputs) {
  outputs->push_back(std::make_unique<Coefficients>(*parameters.sh, light, target));
}

}  // namespace

const MapsProduct kShProduct = {
    "sh", "Spherical harmonics are ordered.", true,
    [](const EnvironmentMapsParameters& parameters) { return parameters.sh.has_value(); },
    order_sh};

}  // namespace lightkiln

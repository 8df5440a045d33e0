// Coefficients of the radiance.

#include <cmath>

#include "core/bake/maps_output.h"
#include "core/environment/brute_force.h"

namespace lightkiln {

namespace {

// Quadrature along rows and rounding, relative to L00.
constexpr double kShErrorBound = 1e-7;

Vec3d coefficient_of(const LatlongSpectrum& spectrum, int l, int m) {
  const double* at = &spectrum.coefficients[spectrum.offset(l, std::abs(m))] + (m < 0 ? 3 : 0);
  return {at[0], at[1], at[2]};
}

class Coefficients : public MapsOutput {
 public:
  Coefficients(int bands, bool constant) : bands_(bands), constant_(constant) {}

  double error_bound() const override { return constant_ ? 0 : kShErrorBound; }
  SpectrumNeed spectrum_need() const override { return {constant_ ? 0 : bands_, nullptr}; }
  double model_seconds(MapsLight&) const override { return 0; }

  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    ShRgb sh(bands_);
    MeasuredError measured;
    if (light.constant()) {
      sh.coefficients[0] = light.environment().mean * (2 * std::sqrt(kPi));
    } else {
      sh = world_harmonics(light.spectrum(progress), bands_);
      measured = check(light, check_texels, progress);
    }
    for (const Vec3d& c : sh.coefficients) {
      for (int channel = 0; channel < 3; ++channel) writer.f64(c[channel]);
    }
    return measured;
  }

  void file(ByteReader& reader, const MeasuredError& measured, Assembly*,
            EnvironmentDocument* document) const override {
    ShDocument sh;
    sh.sh = ShRgb(bands_);
    for (Vec3d& c : sh.sh.coefficients) {
      for (int channel = 0; channel < 3; ++channel) c[channel] = reader.f64();
    }
    sh.selftest = make_selftest(sh.sh);
    sh.error = error_bound();
    document->sh = std::move(sh);
    document->sh_measured = measured;
  }

 private:
  // The turn into the world frame is a rotation, which tests hold to 1e-12; what is checked here is
  // the projection.
  MeasuredError check(MapsLight& light, int count, Progress& progress) const {
    const LatlongSpectrum& spectrum = light.spectrum(progress);
    ErrorMeter meter(length(coefficient_of(spectrum, 0, 0)));
    for (int i = 0; i < count; ++i) {
      progress.check();
      const size_t index = check_index(i, sh_coefficient_count(bands_));
      const int l = static_cast<int>(std::sqrt(static_cast<double>(index)));
      const int m = static_cast<int>(index) - l * l - l;
      meter.add(coefficient_of(spectrum, l, m), projected_coefficient(light.environment(), l, m));
    }
    return meter.result();
  }

  int bands_;
  bool constant_;
};

void order_sh(const EnvironmentMapsParameters& parameters, MapsLight& light, double,
              MapsOutputs* outputs) {
  outputs->push_back(std::make_unique<Coefficients>(parameters.sh->bands, light.constant()));
}

}  // namespace

const MapsProduct kShProduct = {
    "sh", "Spherical harmonics are ordered.", true,
    [](const EnvironmentMapsParameters& parameters) { return parameters.sh.has_value(); },
    order_sh};

}  // namespace lightkiln

// Energy by band and the bands that are enough.

#include <cmath>

#include "core/bake/accuracy.h"
#include "core/bake/maps_cost.h"
#include "core/bake/maps_sh.h"

namespace lightkiln {

namespace {

// The most bands that an order of coefficients can have: advice goes so far, whatever is listed.
constexpr int kAdvisedBands = 129;
// Bands that are measured. What lies beyond is bounded by its rms times the cosine's factor there,
// 1.5e-6: under a clear sky's sun, with an rms of 200 means, 3e-4 of the mean irradiance.
constexpr int kMeasuredBands = 257;

class Spectrum : public MapsOutput {
 public:
  Spectrum(int bands, const MapsLight& light, double target)
      : bands_(bands), constant_(light.constant()), ordered_(ordered_error(target)) {
    if (constant_) return;
    need_ = coefficients_need(kMeasuredBands, target);
    bound_ = coefficients_bound(need_, light.environment().radiance.height);
  }

  double error_bound() const override { return bound_; }
  SpectrumNeed spectrum_need() const override { return {need_, nullptr}; }
  double model_seconds(MapsLight& light) const override {
    const Image& map = light.environment().radiance;
    return constant_ ? 0 : kEnergyPerTexel * map.width * map.height;
  }

  // Bytes: the mean, the whole energy, the energy of each band.
  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    const Environment& environment = light.environment();
    const Vec3d whole = constant_ ? environment.mean * environment.mean * (4 * kPi)
                                  : latlong_energy(environment.radiance, light.threads(), progress);
    std::vector<Vec3d> energy(kMeasuredBands);
    if (constant_) {
      energy[0] = whole;
    } else {
      const std::vector<Vec3d> known = band_energy(light.spectrum(progress));
      std::copy_n(known.begin(), energy.size(), energy.begin());
    }
    for (const Vec3d& v : {environment.mean, whole}) write(v, writer);
    for (const Vec3d& v : energy) write(v, writer);
    return check_coefficients(light, bands_, check_texels, progress);
  }

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    const Vec3d mean = read(reader), whole = read(reader);
    std::vector<Vec3d> energy(kMeasuredBands);
    for (Vec3d& v : energy) v = read(reader);
    SpectrumDocument spectrum;
    spectrum.spectrum = make_spectrum(energy, whole, mean, kAdvisedBands);
    spectrum.rows = bands_;
    spectrum.ordered = advise_bands(spectrum.spectrum, ordered_);
    for (const double error : kQuotedErrors) {
      spectrum.quoted.push_back(advise_bands(spectrum.spectrum, error));
    }
    spectrum.error_bound = error_bound();
    spectrum.measured = measured;
    result->document.spectrum = std::move(spectrum);
  }

 private:
  static void write(const Vec3d& v, ByteWriter& writer) {
    for (int channel = 0; channel < 3; ++channel) writer.f64(v[channel]);
  }
  static Vec3d read(ByteReader& reader) {
    Vec3d v;
    for (int channel = 0; channel < 3; ++channel) v[channel] = reader.f64();
    return v;
  }

  int bands_;
  bool constant_;
  double ordered_;
  ShNeed need_;  // none of a constant map
  double bound_ = 0;
};

void order_spectrum(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
                    MapsOutputs* outputs) {
  outputs->push_back(std::make_unique<Spectrum>(parameters.spectrum->bands, light, target));
}

}  // namespace

const MapsProduct kSpectrumProduct = {
    "spectrum", "The spectrum by band is ordered.", true,
    [](const EnvironmentMapsParameters& parameters) { return parameters.spectrum.has_value(); },
    order_spectrum};

}  // namespace lightkiln

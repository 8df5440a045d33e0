// Irradiance cubes: of the whole map, or of its first bands alone with what that leaves out.

#include <algorithm>
#include <array>
#include <cmath>

#include "core/bake/maps_cost.h"
#include "core/bake/maps_cube.h"
#include "core/base/instruction_sets.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

namespace {

const std::string kQuantity = "irradiance at a surface whose normal is the direction";

class IrradianceCube : public ConvolvedCube {
 public:
  IrradianceCube(MapsLight& light, int size, double target)
      : ConvolvedCube(light, size, Lobe{LobeKind::ggx, 1}, kPi, target) {}

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    add_cube("irradiance.exr", read(reader), {{"lightkiln.quantity", kQuantity}}, result);
    result->document.irradiance = IrradianceDocument{
        {"irradiance.exr", size(), 0, error_bound(), measured, 0, result->faces}, {}};
  }
};

// Bonnet's recurrence for up to 64 cosines side by side.
LIGHTKILN_CLONES void add_bands(const std::vector<double>& factors, double from, double along,
                                double weight, const double* places, double* values, size_t count) {
  std::array<double, 64> cosines, before{}, value;
  for (size_t i = 0; i < count; ++i) {
    cosines[i] = 1 - (from + along * places[i]);
    value[i] = 1;
    values[i] += weight * factors[0];
  }
  for (size_t l = 1; l < factors.size(); ++l) {
    const double degree = static_cast<double>(l), grow = (2 * degree - 1) / degree;
    const double keep = (degree - 1) / degree, factor = weight * factors[l];
    for (size_t i = 0; i < count; ++i) {
      const double next = grow * cosines[i] * value[i] - keep * before[i];
      before[i] = value[i];
      value[i] = next;
      values[i] += factor * next;
    }
  }
}

// The first bands of the cosine lobe, for the twin: the sum of (2l + 1) h_l P_l / (4 pi), |P_l| <=
// 1, which waves no faster than its last band.
class BandedCosine final : public TwinLobe {
 public:
  explicit BandedCosine(const std::vector<double>& responses) : factors_(responses) {
    for (size_t l = 0; l < factors_.size(); ++l) {
      factors_[l] *= (2 * static_cast<double>(l) + 1) / (4 * kPi);
      largest_ += std::abs(factors_[l]);
    }
  }
  void add(double from, double along, double weight, std::span<const double> places,
           double* values) const override {
    constexpr size_t kAtOnce = 64;
    for (size_t begin = 0; begin < places.size(); begin += kAtOnce) {
      const size_t count = std::min(kAtOnce, places.size() - begin);
      add_bands(factors_, from, along, weight, &places[begin], values + begin, count);
    }
  }
  // Bernstein: a derivative of band l is at most l times as large. Rules allow for 5.3 times.
  double width_rad(double) const override {
    return 5.3 / static_cast<double>(std::max<size_t>(2, factors_.size()) - 1);
  }
  std::optional<double> largest() const override { return largest_; }

 private:
  std::vector<double> factors_;
  double largest_ = 0;
};

class BandedIrradianceCube : public MapsOutput {
 public:
  BandedIrradianceCube(MapsLight& light, int size, int bands, double target)
      : size_(size), bands_(bands), constant_(light.constant()) {
    if (constant_) return;
    plan_ = plan_irradiance_bands(light.statistics(), bands, target);
    whole_ = plan_lobe(light.statistics(), {LobeKind::ggx, 1}, target);
  }

  double error_bound() const override { return plan_.error_bound; }
  // What is left out is told from the bands that the whole would need. The bands themselves may err
  // by as much as the level: sum_{l >= 1} h_l^2 is 0.52.
  SpectrumNeed spectrum_need() const override {
    if (constant_) return {};
    return {{bands_, plan_.row_error}, &whole_};
  }
  double model_seconds(MapsLight&) const override {
    return constant_ ? 0 : kPerTexel * 6.0 * size_ * size_;
  }

  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    Image cube(size_, 6 * size_, 3);
    OmittedLight omitted;
    MeasuredError measured;
    if (constant_) {
      const Vec3 value = to_float(light.environment().mean * kPi);
      for (size_t i = 0; i < cube.pixels.size(); i += 3) std::copy_n(&value.x, 3, &cube.pixels[i]);
    } else {
      light.counters().cube_texels += cube.pixels.size() / 3;
      const LatlongSpectrum& spectrum = light.spectrum(progress);
      cube = convolve_lobe(light.environment(), light.statistics(), spectrum, plan_, size_,
                           light.threads(), progress);
      for (float& value : cube.pixels) value = static_cast<float>(kPi * double(value));
      omitted = omitted_irradiance(light.statistics(), spectrum, bands_);
      measured = check(light, cube, check_texels, progress);
    }
    writer.floats(cube.pixels);
    writer.f64(omitted.rms);
    writer.f64(omitted.most);
    return measured;
  }

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    Image cube(size_, 6 * size_, 3);
    reader.floats(cube.pixels);
    const double rms = reader.f64(), most = reader.f64();
    add_cube("irradiance.exr", std::move(cube),
             {{"lightkiln.quantity", kQuantity}, {"lightkiln.bands", std::to_string(bands_)}},
             result);
    result->document.irradiance = IrradianceDocument{
        {"irradiance.exr", size_, 0, error_bound(), measured, 0, result->faces}, bands_, rms, most};
  }

 private:
  // Against the same bands, not against the whole.
  MeasuredError check(MapsLight& light, const Image& cube, int count, Progress& progress) const {
    const CheckedTexels checked(count, size_);
    const LobeAverages truths =
        lobe_averages(light.environment(), BandedCosine(plan_.responses),
                      checked.directions(light.environment().pending), light.threads(), progress);
    return checked.compare(cube, truths, kPi, kPi * luminance(light.environment().mean));
  }

  int size_, bands_;
  bool constant_;
  LobePlan plan_, whole_;  // empty for a constant map
};

void order_irradiance(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
                      MapsOutputs* outputs) {
  constexpr int kUsualBands = 3;
  const IrradianceOutput& order = *parameters.irradiance;
  if (order.method == IrradianceMethod::exact) {
    outputs->push_back(std::make_unique<IrradianceCube>(light, order.size, target));
  } else {
    outputs->push_back(std::make_unique<BandedIrradianceCube>(
        light, order.size, order.bands.value_or(kUsualBands), target));
  }
}

}  // namespace

const MapsProduct kIrradianceProduct = {
    "irradiance", "An irradiance cube is ordered.", true,
    [](const EnvironmentMapsParameters& parameters) { return parameters.irradiance.has_value(); },
    order_irradiance};

}  // namespace lightkiln

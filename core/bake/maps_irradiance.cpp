// Irradiance cubes: of the whole map, or of its first bands alone with what that leaves out.

#include "core/bake/maps_cost.h"
#include "core/bake/maps_cube.h"
#include "core/environment/brute_force.h"
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

// The first bands of the cosine lobe as a function of the cosine, for the twin.
class BandedCosine {
 public:
  explicit BandedCosine(const std::vector<double>& responses) : responses_(responses) {}
  double operator()(double cosine) const {
    double before = 0, value = 1, sum = 0;
    for (size_t l = 0; l < responses_.size(); ++l) {
      const double degree = static_cast<double>(l);
      if (l > 0) {
        const double next = ((2 * degree - 1) * cosine * value - (degree - 1) * before) / degree;
        before = value;
        value = next;
      }
      sum += (2 * degree + 1) / (4 * kPi) * responses_[l] * value;
    }
    return sum;
  }
  void fill(std::span<const double> cosines, std::span<double> values) const {
    std::transform(cosines.begin(), cosines.end(), values.begin(), *this);
  }

 private:
  const std::vector<double>& responses_;
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
    const std::vector<Vec3d> truths = lobe_averages(
        light.environment(), BandedCosine(plan_.responses), {.elsewhere_rad = 1.0 / bands_},
        checked.directions(), light.threads(), progress);
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

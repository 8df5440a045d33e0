#include "core/bake/maps_output.h"

#include <algorithm>
#include <cmath>

#include "core/image/exr.h"

namespace lightkiln {

std::span<const MapsProduct> maps_products() {
  static const MapsProduct products[] = {
      kSunProduct, kShProduct,       kIrradianceProduct, kPrefilterProduct, kSheenProduct,
      kDfgProduct, kSpectrumProduct, kAssetProduct,      kLayoutsProduct,   kLightSetProduct};
  return products;
}

MapsOutputs order_outputs(const EnvironmentMapsParameters& parameters, MapsLight& light,
                          double target) {
  MapsOutputs outputs;
  for (const MapsProduct& product : maps_products()) {
    if (product.ordered(parameters)) product.order(parameters, light, target, &outputs);
  }
  return outputs;
}

std::vector<LobePlan> lobes_of(const MapsOutputs& outputs) {
  std::vector<LobePlan> lobes;
  for (const auto& output : outputs) {
    if (const LobePlan* lobe = output->spectrum_need().lobe) lobes.push_back(*lobe);
  }
  return lobes;
}

// The most bands, as exactly as the strictest asks.
ShNeed sh_need_of(const MapsOutputs& outputs) {
  ShNeed most{0, 1};
  for (const auto& output : outputs) {
    const ShNeed need = output->spectrum_need().sh;
    if (need.bands == 0) continue;
    most = {std::max(most.bands, need.bands), std::min(most.error, need.error)};
  }
  return most;
}

void require_spectrum(const MapsOutputs& outputs, MapsLight* light) {
  light->require(sh_need_of(outputs), lobes_of(outputs));
}

namespace {

constexpr double kOrderedPerWorking = 10;

}  // namespace

double working_target(double target_error) {
  return target_error / kOrderedPerWorking;
}

double ordered_error(double working_target) {
  return working_target * kOrderedPerWorking;
}

size_t check_index(int i, size_t all) {
  constexpr double kGolden = 0.6180339887498949;
  const double place = 0.5 + i * kGolden;
  const size_t index = static_cast<size_t>((place - std::floor(place)) * static_cast<double>(all));
  return std::min(index, all - 1);
}

void ErrorMeter::add(const Vec3d& value, const Vec3d& truth) {
  const Vec3d error = (value - truth) * (scale_ > 0 ? 1 / scale_ : 1.0);
  ++measured_.count;
  squares_ += error * error;
  for (int c = 0; c < 3; ++c) measured_.max = std::max(measured_.max, std::abs(error[c]));
}

MeasuredError ErrorMeter::result() const {
  MeasuredError measured = measured_;
  const double most = std::max({squares_.x, squares_.y, squares_.z});
  if (measured.count > 0) measured.rms = std::sqrt(most / static_cast<double>(measured.count));
  return measured;
}

void judge_output(double bound, const MeasuredError& measured, double target, ChunkReport* report,
                  Round* round) {
  const double error = std::max(bound, measured.rms);
  round->error_sum_sq += error * error;
  round->error_max = std::max({round->error_max, bound, measured.max});
  if (bound > target)
    ++report->budget_limited;
  else if (measured.max - measured.twin > target)
    ++report->suspicious;
  else
    ++round->converged;
}

namespace {

// Half-texel centres are what engines sample. OpenEXR's `envmap` attribute would claim centres on
// the borders and is therefore not written; these attributes say what the file is.
ExrWriteOptions cube_options(std::map<std::string, std::string> attributes,
                             const MapsResult& result) {
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  options.attributes = std::move(attributes);
  options.attributes.emplace("lightkiln.layout", describe_strip(result.faces));
  options.attributes.emplace("lightkiln.texel_convention",
                             "half_texel: texel centres at (i + 1/2)/N of a face");
  tell_faces(result.faces, &options.attributes);
  options.threads = result.threads;
  return options;
}

}  // namespace

void add_cube(const std::string& name, Image cube, std::map<std::string, std::string> attributes,
              MapsResult* result) {
  add_image(name, ordered_faces(std::move(cube), result->faces),
            cube_options(std::move(attributes), *result), &result->assembly);
}

void add_mip_mapped_cube(const std::string& name, std::vector<Image> levels,
                         std::map<std::string, std::string> attributes, MapsResult* result) {
  for (Image& level : levels) level = ordered_faces(std::move(level), result->faces);
  add_mip_mapped_image(name, levels, cube_options(std::move(attributes), *result),
                       &result->assembly);
}

}  // namespace lightkiln

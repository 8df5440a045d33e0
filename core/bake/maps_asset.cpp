// A glTF asset that lights a scene by the map: EXT_lights_image_based. An output is a level of its
// chain; its bytes are six PNG files and what packing changed, before them at level 0 the nine
// coefficients and what a window did to them.

#include <algorithm>
#include <cmath>

#include "core/bake/maps_cost.h"
#include "core/bake/maps_cube.h"
#include "core/bake/maps_sh.h"
#include "core/bake/window_report.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/environment/lookup_cube.h"
#include "core/image/rgbd.h"
#include "core/scene/gltf_image_light.h"
#include "core/sphere/harmonic_exports.h"

namespace lightkiln {

namespace {

constexpr int kSmallestFace = 16;  // enough for roughness 1, as the extension's text says

int level_count(int size) {
  int levels = 1;
  for (int side = size; side > kSmallestFace; side /= 2) ++levels;
  return levels;
}

// Babylon.js 9 looks up level log2(size alpha) (levels - 1) / log2(size): alpha of a level is
// size^(level / (levels - 1) - 1), and roughness its root. Level 0 would have alpha 1 / size, a
// lobe narrower than a texel; it holds the map itself.
double roughness_of(AssetRoughness rule, int level, int levels, int size) {
  const double share = double(level) / (levels - 1);
  if (rule == AssetRoughness::linear || level == 0) return share;
  return std::pow(size, (share - 1) / 2);
}

class AssetLevel : public ConvolvedCube {
 public:
  AssetLevel(MapsLight& light, int size, int index, int levels, double roughness, ShWindow window,
             double target, std::shared_ptr<GltfImageLight> asset)
      : ConvolvedCube(light, size,
                      roughness > 0 ? std::optional(Lobe{LobeKind::ggx, roughness * roughness})
                                    : std::nullopt,
                      1, target),
        sh_need_(coefficients_need(kBands, target)),
        index_(index),
        levels_(levels),
        roughness_(roughness),
        window_(window),
        asset_(std::move(asset)) {}

  SpectrumNeed spectrum_need() const override {
    SpectrumNeed need = ConvolvedCube::spectrum_need();
    if (index_ == 0 && !constant()) need.sh = sh_need_;
    return need;
  }

  double model_seconds(MapsLight& light) const override {
    const double window = index_ == 0 && !constant() ? window_seconds(window_, kBands) : 0;
    return ConvolvedCube::model_seconds(light) + kRgbdPerTexel * 6 * size() * size() + window;
  }

  std::string warning(MapsLight& light) const override {
    if (index_ > 0) return {};
    const Vec3 highest =
        light.constant() ? to_float(light.environment().mean) : light.statistics().highest;
    const double largest = std::max({highest.x, highest.y, highest.z});
    if (largest <= kMaxRgbd) return {};
    return "The map is as bright as " + short_number(largest) +
           "; the RGBD images of a glTF asset "
           "hold at most " +
           short_number(kMaxRgbd) +
           ": brighter texels are cut, and the document "
           "tells how much of each level's light.";
  }

  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    if (index_ == 0) write_coefficients(light, writer, progress);
    const Image cube = make_cube(light, progress);
    std::array<RgbdLoss, 6> losses;
    std::array<std::vector<std::byte>, 6> files;
    parallel_blocks(6, 1, light.threads(), progress, [&](size_t face, size_t) {
      const Image image = lookup_face(cube, static_cast<int>(face));
      files[face] = write_png(encode_rgbd(image, &losses[face]));
    });
    for (const auto& file : files) writer.sized(file);
    write_loss(cube, losses, writer);
    return constant() ? MeasuredError{} : check(light, cube, check_texels, progress);
  }

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    if (index_ == 0) {
      *asset_ = {};
      asset_->name = "environment";
      asset_->size = size();
      for (Vec3d& c : asset_->irradiance_coefficients)
        for (int channel = 0; channel < 3; ++channel) c[channel] = reader.f64();
      result->document.asset.emplace();
      if (window_ != ShWindow::none) {
        result->document.asset->sh_window = read_window_report(window_, kQuantity, kBands, reader);
      }
    }
    auto& faces = asset_->specular_images.emplace_back();
    for (auto& face : faces) face = reader.sized();
    AssetLevelDocument level{size(), roughness_, error_bound(), measured};
    const double mean = luminance(result->document.mean);
    const double unit = mean > 0 ? mean : 1;
    level.packing_rms = reader.f64() / unit;
    level.packing_max = reader.f64() / unit;
    level.cut_texels = reader.u64();
    level.cut_share = reader.f64();
    result->document.asset->levels.push_back(level);
    if (index_ + 1 < levels_) return;
    result->document.asset->artifact = "environment.glb";
    result->assembly.artifacts.push_back(
        {"environment.glb", "glb", "model/gltf-binary",
         write_gltf_image_light(*asset_, "Lightkiln " LIGHTKILN_VERSION)});
  }

 private:
  static constexpr int kBands = 3;
  // What the coefficients are for.
  static constexpr ShQuantity kQuantity = ShQuantity::irradiance;

  void write_coefficients(MapsLight& light, ByteWriter& writer, Progress& progress) const {
    const WindowedSh windowed = window_sh(radiance_coefficients(light, kBands, progress), window_,
                                          kQuantity, light.threads(), progress);
    for (const Vec3d& c : export_sh(windowed.sh, ShTarget::ext_lights_image_based).coefficients)
      for (int channel = 0; channel < 3; ++channel) writer.f64(c[channel]);
    if (window_ != ShWindow::none) write_window_report(windowed.report, writer);
  }

  // The loss of the whole level; cutting counts by texels, whose solid angles differ by little.
  static void write_loss(const Image& cube, const std::array<RgbdLoss, 6>& losses,
                         ByteWriter& writer) {
    double squares = 0, largest = 0, cut_off = 0, sum = 0;
    uint64_t cut = 0;
    const size_t face_values = cube.pixels.size() / 6;
    for (size_t face = 0; face < 6; ++face) {
      const RgbdLoss& loss = losses[face];
      squares += loss.rms * loss.rms / 6;
      largest = std::max(largest, loss.largest);
      cut += loss.cut;
      cut_off += loss.cut_off;
      for (size_t i = 0; i < face_values; ++i) sum += double{cube.pixels[face * face_values + i]};
    }
    writer.f64(std::sqrt(squares));
    writer.f64(largest);
    writer.u64(cut);
    writer.f64(sum > 0 ? cut_off / sum : 0);
  }

  ShNeed sh_need_;
  int index_, levels_;
  double roughness_;
  ShWindow window_;
  std::shared_ptr<GltfImageLight> asset_;  // what the levels before have filed
};

void order_asset(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
                 MapsOutputs* outputs) {
  const auto& [size, rule, window] = *parameters.asset;
  const int levels = level_count(size);
  const auto asset = std::make_shared<GltfImageLight>();
  for (int level = 0; level < levels; ++level) {
    outputs->push_back(std::make_unique<AssetLevel>(light, size >> level, level, levels,
                                                    roughness_of(rule, level, levels, size), window,
                                                    target, asset));
  }
}

// The order reaches up to packing: eight bits a channel have one error at any price.
Effect asset_effect(const MapsLight&) {
  return {
      "asset", true,
      "A glTF asset lit by the map is ordered. Its levels are made to the order; the RGBD images "
      "that the format asks for then round each channel by up to " +
          short_number(100 * kRgbdStep) +
          " % of its texel's largest, at any order, and the document tells what that changed.",
      kRgbdStep};
}

}  // namespace

const MapsProduct kAssetProduct = {
    "asset",
    "A glTF asset lit by the map is ordered.",
    true,
    [](const EnvironmentMapsParameters& parameters) { return parameters.asset.has_value(); },
    order_asset,
    asset_effect};

}  // namespace lightkiln

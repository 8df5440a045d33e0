#include "core/bake/spec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>

#include "core/base/text.h"
#include "core/environment/charlie_lobe.h"

namespace lightkiln {

const char* kind_name(Kind kind) {
  switch (kind) {
    case Kind::ambient_occlusion:
      return "ambient_occlusion";
    case Kind::environment_maps:
      return "environment_maps";
    case Kind::probes:
      return "probes";
  }
  return "";
}

double default_target_error(Kind kind) {
  switch (kind) {
    case Kind::ambient_occlusion:
      return 0.02;
    case Kind::environment_maps:
      return 0.001;
    case Kind::probes:
      return 0.05;
  }
  return 0.02;
}

double target_error(const Spec& spec) {
  return spec.accuracy.target_error.value_or(default_target_error(spec.kind()));
}

uint64_t max_samples(const Spec& spec) {
  return std::bit_ceil(spec.accuracy.max_samples.value_or(65536));
}

uint64_t probe_bytes(const ProbesParameters& parameters) {
  const auto size = static_cast<uint64_t>(parameters.cubemap.size);
  const auto bands = static_cast<uint64_t>(parameters.sh.bands);
  return 6 * size * size * 16 + bands * bands * 24;
}

namespace {

// Collects faults; each check reads as one sentence of the contract.
class Checker {
 public:
  void fault(std::string pointer, std::string code, std::string message, std::string allowed = "") {
    faults_.push_back(
        {std::move(pointer), std::move(code), std::move(message), std::move(allowed)});
  }
  void positive(const std::optional<double>& value, const std::string& pointer,
                const std::string& name) {
    if (value && !(std::isfinite(*value) && *value > 0))
      fault(pointer, "range", name + " must be a finite number above 0.");
  }
  template <typename T>
  void between(T value, T low, T high, const std::string& pointer, const std::string& name) {
    if (value < low || value > high)
      fault(pointer, "range",
            name + " is " + std::to_string(value) + "; allowed are " + std::to_string(low) +
                " to " + std::to_string(high) + ".");
  }
  std::vector<SpecFault> take() { return std::move(faults_); }

 private:
  std::vector<SpecFault> faults_;
};

bool is_blob_digest(const std::string& text) {
  constexpr std::string_view kPrefix = "sha256:";
  if (text.size() != kPrefix.size() + 64 || !text.starts_with(kPrefix)) return false;
  return text.find_first_not_of("0123456789abcdef", kPrefix.size()) == std::string::npos;
}

// Relative, and never upwards: the URI is a key, not a path, but it may become a name elsewhere.
bool is_plain_uri(const std::string& uri) {
  if (uri.empty() || uri.front() == '/' || uri.find('\\') != std::string::npos ||
      uri.find(':') != std::string::npos)
    return false;
  for (size_t begin = 0; begin <= uri.size();) {
    const size_t end = std::min(uri.find('/', begin), uri.size());
    if (uri.substr(begin, end - begin) == "..") return false;
    begin = end + 1;
  }
  return true;
}

void check_faces(const InputRef& input, const std::string& pointer, Checker& checker) {
  if (!input.blob.empty() || !input.resources.empty())
    checker.fault(pointer, "conflict",
                  "An environment is one file or six faces: faces stand without blob and without "
                  "resources.");
  if (input.faces.size() != kCubeFaceNames.size())
    checker.fault(pointer + "/faces", "missing", "A cube has six faces: px, nx, py, ny, pz, nz.");
  for (size_t i = 0; i < std::min(input.faces.size(), kCubeFaceNames.size()); ++i) {
    if (!is_blob_digest(input.faces[i]))
      checker.fault(pointer + "/faces/" + kCubeFaceNames[i], "type",
                    "A face is a digest \"sha256:\" followed by 64 lower-case hexadecimal digits.");
  }
}

void check_input(const InputRef& input, const std::string& pointer, Checker& checker) {
  if (!input.faces.empty()) return check_faces(input, pointer, checker);
  if (!is_blob_digest(input.blob))
    checker.fault(pointer, "type",
                  "An input is a digest \"sha256:\" followed by 64 lower-case hexadecimal digits.");
  for (const auto& [uri, digest] : input.resources) {
    if (!is_plain_uri(uri))
      checker.fault(pointer + "/resources", "range",
                    "The resource URI \"" + uri + "\" must be relative and free of \"..\".");
    if (!is_blob_digest(digest))
      checker.fault(pointer + "/resources", "type",
                    "The resource \"" + uri +
                        "\" needs a digest \"sha256:\" followed by 64 "
                        "lower-case hexadecimal digits.");
  }
}

void require_input(const std::optional<InputRef>& input, const std::string& name, Kind kind,
                   Checker& checker) {
  if (!input)
    checker.fault("/inputs/" + name, "missing",
                  std::string(kind_name(kind)) + " needs the input \"" + name + "\".");
}

void refuse_input(const std::optional<InputRef>& input, const std::string& name, Kind kind,
                  Checker& checker) {
  if (input)
    checker.fault("/inputs/" + name, "conflict",
                  std::string(kind_name(kind)) + " does not use the input \"" + name + "\".");
}

void check_ambient_occlusion(const AmbientOcclusionParameters& p, Checker& checker) {
  checker.positive(p.max_distance, "/parameters/max_distance", "max_distance");
  checker.positive(p.falloff_distance, "/parameters/falloff_distance", "falloff_distance");
  const bool scaled = p.falloff == Falloff::linear || p.falloff == Falloff::quadratic ||
                      p.falloff == Falloff::smooth;
  if (scaled && !p.max_distance)
    checker.fault("/parameters/max_distance", "missing",
                  "The falloffs linear, quadratic and smooth need a max_distance.");
  if (p.falloff == Falloff::exponential && !p.falloff_distance)
    checker.fault("/parameters/falloff_distance", "missing",
                  "The falloff exponential needs a falloff_distance.");
  if (p.falloff != Falloff::exponential && p.falloff_distance)
    checker.fault("/parameters/falloff_distance", "conflict",
                  "falloff_distance belongs to the falloff exponential only.");
}

// Of maps and of probes.
void check_window(ShWindow window, ShQuantity quantity, Checker& checker) {
  if (window == ShWindow::none && quantity != ShQuantity::irradiance)
    checker.fault("/parameters/sh/window_quantity", "conflict",
                  "window_quantity says what a window is for; it needs a window other than none.");
}

void check_sh(const ShOutput& sh, Checker& checker) {
  checker.between(sh.bands, 1, 129, "/parameters/sh/bands", "bands");
  check_window(sh.window, sh.window_quantity, checker);
  if (sh.exports >> std::size(kShTargets) != 0)
    checker.fault("/parameters/sh/exports", "range", "exports names an engine that is not known.");
}

bool any_layout(const LayoutOrders& orders) {
  return std::any_of(orders.begin(), orders.end(),
                     [](const auto& order) { return order.has_value(); });
}

void check_distance(const std::optional<double>& distance, const std::string& pointer,
                    Checker& checker) {
  if (distance && !(*distance > 1 && *distance <= 1e6))
    checker.fault(pointer + "/distance", "range",
                  "distance must be above 1, the ball's own radius, and at most 1e6.");
}

void check_source(const SourceParameters& p, const Spec& spec, Checker& checker) {
  const std::string pointer = "/parameters/source";
  const bool six_files = spec.environment && !spec.environment->faces.empty();
  if (six_files && p.layout && p.layout != LayoutKind::cube_strip)
    checker.fault(pointer + "/layout", "conflict",
                  "Six faces are a cube: layout is auto or cube_strip.", "auto, cube_strip");
  const bool cube = six_files || (p.layout && is_cube(*p.layout));
  if (p.face_orientation != FaceOrientation::openexr && !cube)
    checker.fault(pointer + "/face_orientation", "conflict",
                  "face_orientation belongs to six faces and to the layouts cube_strip, "
                  "horizontal_cross and vertical_cross.");
  const bool ball = p.layout == LayoutKind::mirror_ball;
  if (p.distance && !ball)
    checker.fault(pointer + "/distance", "conflict", "distance belongs to the layout mirror_ball.");
  if (p.mirrored && !ball && p.layout != LayoutKind::angular)
    checker.fault(pointer + "/mirrored", "conflict",
                  "mirrored belongs to the layouts angular and mirror_ball.");
  check_distance(p.distance, pointer, checker);
  const bool borders =
      !p.layout || p.layout == LayoutKind::latlong || p.layout == LayoutKind::cube_strip;
  if (p.texel_convention == TexelConvention::openexr && !borders)
    checker.fault(pointer + "/texel_convention", "conflict",
                  "openexr belongs to the layouts latlong and cube_strip.");
}

void check_rotation(const RotationParameters& p, Checker& checker) {
  const std::string pointer = "/parameters/rotation";
  const RotationParameters still;
  double square = 0;
  for (const double part : p.quaternion) square += part * part;
  if (p.quaternion.size() != 4 || !(square > 1e-12 && square < 1e13))
    checker.fault(pointer + "/quaternion", "range",
                  "A quaternion is four numbers x, y, z, w of a length from 1e-6 to 3e6.");
  if (!(std::fabs(p.yaw_degrees) <= 360))
    checker.fault(pointer + "/yaw_degrees", "range", "yaw_degrees must be from -360 to 360.");
  if (p.yaw_degrees != 0 && p.quaternion != still.quaternion)
    checker.fault(pointer + "/yaw_degrees", "conflict",
                  "A rotation is given by quaternion or by yaw_degrees, not by both.");
}

void check_layouts(const LayoutOrders& orders, Checker& checker) {
  for (size_t product = 0; product < kLayoutProducts; ++product) {
    if (!orders[product]) continue;
    const LayoutOutput& order = *orders[product];
    const MapLayout layout = layout_of(product, order);
    const std::string pointer = std::string("/parameters/layouts/") + layout_product_name(product);
    const bool wide = layout.kind == LayoutKind::latlong || layout.kind == LayoutKind::cylinder ||
                      layout.kind == LayoutKind::cylinder_equal_area;
    const std::string name = wide ? "width" : "size";
    const bool borders = order.texel_convention == TexelConvention::openexr;
    const int least = wide || borders || !is_cube(layout.kind) ? 2 : 1;
    const int most = wide ? 8192 : is_cube(layout.kind) ? 2048 : 4096;
    checker.between(order.size, least, most, pointer + "/" + name, name);
    if (order.height) checker.between(*order.height, 1, 4096, pointer + "/height", "height");
    check_distance(order.distance, pointer, checker);
    if (wide && order.size % 2 != 0)
      checker.fault(pointer + "/width", "range", "width must be even.");
    if (layout.kind == LayoutKind::latlong && borders && order.size < 4)
      checker.fault(pointer + "/width", "range", "width must be at least 4 with openexr.");
  }
}

void check_cubes(const EnvironmentMapsParameters& p, Checker& checker) {
  if (p.cubes.face_orientation == FaceOrientation::openexr) return;
  bool cube = p.irradiance || p.prefilter || p.sheen || p.layouts[kCubeFaces];
  for (size_t product = 0; product < kCubeFaces; ++product)
    cube |= p.layouts[product] && is_cube(static_cast<LayoutKind>(product));
  if (!cube)
    checker.fault("/parameters/cubes/face_orientation", "conflict",
                  "face_orientation turns the cubes that an order writes, and none is ordered: "
                  "prefilter, sheen, irradiance, or cube_strip, cube_faces, horizontal_cross or "
                  "vertical_cross of layouts.",
                  "openexr");
}

void check_irradiance(const IrradianceOutput& irradiance, Checker& checker) {
  checker.between(irradiance.size, 1, 1024, "/parameters/irradiance/size", "size");
  if (!irradiance.bands) return;
  checker.between(*irradiance.bands, 1, 33, "/parameters/irradiance/bands", "bands");
  if (irradiance.method == IrradianceMethod::exact)
    checker.fault("/parameters/irradiance/bands", "conflict",
                  "bands belongs to the method harmonics only: exact has no band limit.");
}

// Custom chains name the roughness of every level, the others none.
void check_roughness(const PrefilterOutput& chain, double least, const std::string& pointer,
                     Checker& checker) {
  const size_t count = chain.roughness.size();
  if (chain.roughness_scale != RoughnessScale::custom) {
    if (count > 0)
      checker.fault(pointer, "conflict", "roughness belongs to the roughness_scale custom only.");
    return;
  }
  if (count == 0)
    checker.fault(pointer, "missing", "The roughness_scale custom needs a list of roughness.");
  else if (count != static_cast<size_t>(chain.levels))
    checker.fault(pointer, "conflict",
                  "There are " + std::to_string(count) + " roughnesses for " +
                      std::to_string(chain.levels) + " levels; each level needs one.");
  for (size_t i = 0; i < count; ++i) {
    const double value = chain.roughness[i];
    if (!(value >= least && value <= 1))
      checker.fault(pointer + "/" + std::to_string(i), "range",
                    "A roughness is at least " + short_number(least) + " and at most 1.");
  }
}

void check_chain(const PrefilterOutput& chain, double least_roughness, const std::string& pointer,
                 Checker& checker) {
  const int size = chain.size, levels = chain.levels;
  if (size < 8 || size > 2048 || !std::has_single_bit(static_cast<unsigned int>(size)))
    checker.fault(
        pointer + "/size", "range",
        "size is " + std::to_string(size) + "; allowed are the powers of two from 8 to 2048.");
  checker.between(levels, 2, 12, pointer + "/levels", "levels");
  if (levels >= 2 && levels <= 12 && size >= 8 && (size >> (levels - 1)) < 1)
    checker.fault(pointer + "/levels", "conflict",
                  "A size of " + std::to_string(size) + " has no " + std::to_string(levels) +
                      " levels: each is half the one before and the last is at least 1.");
  check_roughness(chain, least_roughness, pointer + "/roughness", checker);
}

void check_sun(const SunOrder& sun, Checker& checker) {
  if (!(sun.max_angular_radius_degrees > 0 && sun.max_angular_radius_degrees <= 10))
    checker.fault("/parameters/sun/max_angular_radius_degrees", "range",
                  "max_angular_radius_degrees must be above 0 and at most 10.");
  if (!(sun.min_contrast >= 1 && sun.min_contrast <= 1000))
    checker.fault("/parameters/sun/min_contrast", "range", "min_contrast must be 1 to 1000.");
}

void check_environment_maps(const EnvironmentMapsParameters& p, Checker& checker) {
  if (!p.sun && !p.sh && !p.irradiance && !p.prefilter && !p.sheen && !p.dfg && !p.spectrum &&
      !p.asset && !any_layout(p.layouts) && !p.light_set)
    checker.fault(
        "/parameters", "missing",
        "Order at least one of sun, sh, irradiance, prefilter, sheen, dfg, spectrum, asset, "
        "layouts and light_set.");
  check_rotation(p.rotation, checker);
  check_layouts(p.layouts, checker);
  check_cubes(p, checker);
  if (p.sh) check_sh(*p.sh, checker);
  if (p.spectrum) checker.between(p.spectrum->bands, 1, 129, "/parameters/spectrum/bands", "bands");
  if (p.sun) check_sun(*p.sun, checker);
  if (p.light_set && p.light_set->lights)
    checker.between(*p.light_set->lights, 1, 256, "/parameters/light_set/lights", "lights");
  if (p.irradiance) check_irradiance(*p.irradiance, checker);
  if (p.dfg) checker.between(p.dfg->size, 8, 1024, "/parameters/dfg/size", "size");
  if (p.prefilter) check_chain(*p.prefilter, 0, "/parameters/prefilter", checker);
  if (p.asset) {
    const int side = p.asset->size;
    if (side < 32 || side > 1024 || !std::has_single_bit(static_cast<unsigned int>(side)))
      checker.fault(
          "/parameters/asset/size", "range",
          "size is " + std::to_string(side) + "; allowed are the powers of two from 32 to 1024.");
  }
  if (p.sheen) check_chain(*p.sheen, kMinSheenRoughness, "/parameters/sheen", checker);
}

// What can be held is told by the number of positions, whose cubes the other parameters size.
void check_probe_bytes(const ProbesParameters& p, Checker& checker) {
  const uint64_t each = probe_bytes(p), most = kMostProbeBytes / each;
  if (p.positions.size() <= most) return;
  const std::string size = std::to_string(p.cubemap.size);
  checker.fault("/parameters/positions", "too_large",
                std::to_string(p.positions.size()) + " probes with cubes of " + size +
                    " texels a side take " + std::to_string(p.positions.size() * each) +
                    " bytes; allowed are " + std::to_string(kMostProbeBytes) + ", which is " +
                    std::to_string(most) + " such probes an order.",
                "at most " + std::to_string(most) + " positions at cubemap.size " + size);
}

void check_probes(const ProbesParameters& p, Checker& checker) {
  check_rotation(p.rotation, checker);
  constexpr size_t kMostPositions = 10000;
  if (p.positions.empty() || p.positions.size() > kMostPositions)
    checker.fault(
        "/parameters/positions", p.positions.empty() ? "missing" : "range",
        "There are " + std::to_string(p.positions.size()) + " positions; allowed are 1 to 10000.");
  for (size_t i = 0; i < p.positions.size(); ++i) {
    const Vec3d& position = p.positions[i];
    const double largest =
        std::max({std::fabs(position.x), std::fabs(position.y), std::fabs(position.z)});
    if (!is_finite(position) || largest > 1e18)
      checker.fault("/parameters/positions/" + std::to_string(i), "range",
                    "A position is three finite numbers of at most 1e18.");
  }
  checker.between(p.cubemap.size, 1, 512, "/parameters/cubemap/size", "size");
  checker.between(p.sh.bands, 1, 33, "/parameters/sh/bands", "bands");
  check_window(p.sh.window, p.sh.window_quantity, checker);
  const bool sized = p.cubemap.size >= 1 && p.cubemap.size <= 512 && p.sh.bands >= 1;
  if (sized && p.sh.bands <= 33 && p.positions.size() <= kMostPositions)
    check_probe_bytes(p, checker);
  if (p.max_bounces)
    checker.between(*p.max_bounces, 0, 64, "/parameters/max_bounces", "max_bounces");
}

void check_accuracy(const Accuracy& accuracy, Checker& checker) {
  if (accuracy.target_error && !(*accuracy.target_error > 0 && *accuracy.target_error <= 1))
    checker.fault("/accuracy/target_error", "range", "target_error must be above 0 and at most 1.");
  if (accuracy.max_samples)
    checker.between<uint64_t>(*accuracy.max_samples, 64, 1048576, "/accuracy/max_samples",
                              "max_samples");
  checker.positive(accuracy.max_seconds, "/accuracy/max_seconds", "max_seconds");
  checker.between(accuracy.check_texels, 0, 4096, "/accuracy/check_texels", "check_texels");
}

// What is sampled is measured by its own samples.
void refuse_checks(const Spec& spec, Checker& checker) {
  if (spec.accuracy.check_texels != Accuracy::kDefaultCheckTexels)
    checker.fault("/accuracy/check_texels", "conflict",
                  std::string("check_texels belongs to environment_maps; ") +
                      kind_name(spec.kind()) + " states an error bar with every element.");
}

// Environment maps are sums and transforms: nothing is drawn at random, so there are no samples to
// limit, no seed to vary and no sample count that a time limit could pin.
void refuse_sampling(const Spec& spec, Checker& checker) {
  const std::string fixed = "environment_maps is deterministic and takes no samples, so it has no ";
  const std::string instead = "; target_error and the sizes ordered set what it costs.";
  if (spec.accuracy.max_samples)
    checker.fault("/accuracy/max_samples", "conflict", fixed + "max_samples" + instead);
  if (spec.accuracy.max_seconds)
    checker.fault("/accuracy/max_seconds", "conflict", fixed + "max_seconds" + instead);
  if (spec.seed != 0)
    checker.fault("/seed", "conflict",
                  fixed + "seed; equal orders have equal results, so leave it out.");
}

}  // namespace

std::vector<SpecFault> validate(const Spec& spec) {
  Checker checker;
  const Kind kind = spec.kind();
  switch (kind) {
    case Kind::ambient_occlusion:
      require_input(spec.scene, "scene", kind, checker);
      refuse_input(spec.environment, "environment", kind, checker);
      check_ambient_occlusion(std::get<AmbientOcclusionParameters>(spec.parameters), checker);
      refuse_checks(spec, checker);
      break;
    case Kind::environment_maps:
      refuse_input(spec.scene, "scene", kind, checker);
      require_input(spec.environment, "environment", kind, checker);
      check_source(std::get<EnvironmentMapsParameters>(spec.parameters).source, spec, checker);
      check_environment_maps(std::get<EnvironmentMapsParameters>(spec.parameters), checker);
      refuse_sampling(spec, checker);
      break;
    case Kind::probes:
      require_input(spec.scene, "scene", kind, checker);
      check_source(std::get<ProbesParameters>(spec.parameters).source, spec, checker);
      check_probes(std::get<ProbesParameters>(spec.parameters), checker);
      refuse_checks(spec, checker);
      break;
  }
  if (spec.scene) check_input(*spec.scene, "/inputs/scene", checker);
  if (spec.scene && !spec.scene->faces.empty())
    checker.fault("/inputs/scene/faces", "conflict", "A scene has no faces; an environment has.");
  if (spec.environment) check_input(*spec.environment, "/inputs/environment", checker);
  check_accuracy(spec.accuracy, checker);
  return checker.take();
}

}  // namespace lightkiln

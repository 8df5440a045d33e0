#include <algorithm>
#include <bit>
#include <iterator>

#include "core/bake/spec_checker.h"
#include "core/base/text.h"
#include "core/environment/charlie_lobe.h"

namespace lightkiln {

void check_window(ShWindow window, ShQuantity quantity, SpecChecker& checker) {
  if (window == ShWindow::none && quantity != ShQuantity::irradiance)
    checker.fault("/parameters/sh/window_quantity", "conflict",
                  "window_quantity says what a window is for; it needs a window other than none.");
}

namespace {

void check_sh(const ShOutput& sh, SpecChecker& checker) {
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
                    SpecChecker& checker) {
  if (distance && !(*distance > 1 && *distance <= 1e6))
    checker.fault(pointer + "/distance", "range",
                  "distance must be above 1, the ball's own radius, and at most 1e6.");
}

void check_layouts(const LayoutOrders& orders, SpecChecker& checker) {
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

void check_cubes(const EnvironmentMapsParameters& p, SpecChecker& checker) {
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

void check_irradiance(const IrradianceOutput& irradiance, SpecChecker& checker) {
  checker.between(irradiance.size, 1, 1024, "/parameters/irradiance/size", "size");
  if (!irradiance.bands) return;
  checker.between(*irradiance.bands, 1, 33, "/parameters/irradiance/bands", "bands");
  if (irradiance.method == IrradianceMethod::exact)
    checker.fault("/parameters/irradiance/bands", "conflict",
                  "bands belongs to the method harmonics only: exact has no band limit.");
}

// Custom chains name the roughness of every level, the others none.
void check_roughness(const PrefilterOutput& chain, double least, const std::string& pointer,
                     SpecChecker& checker) {
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
                 SpecChecker& checker) {
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

void check_sun(const SunOrder& sun, SpecChecker& checker) {
  if (!(sun.max_angular_radius_degrees > 0 && sun.max_angular_radius_degrees <= 10))
    checker.fault("/parameters/sun/max_angular_radius_degrees", "range",
                  "max_angular_radius_degrees must be above 0 and at most 10.");
  if (!(sun.min_contrast >= 1 && sun.min_contrast <= 1000))
    checker.fault("/parameters/sun/min_contrast", "range", "min_contrast must be 1 to 1000.");
}

}  // namespace

void check_source(const SourceParameters& p, const Spec& spec, SpecChecker& checker) {
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

void check_rotation(const RotationParameters& p, SpecChecker& checker) {
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

void check_environment_maps(const EnvironmentMapsParameters& p, SpecChecker& checker) {
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

}  // namespace lightkiln

#include "proto/spec_layouts.h"

#include <array>
#include <utility>

namespace lightkiln {
namespace {

using Maps = EnvironmentMapsParameters;

constexpr Range kDistance{1, 1e6, true};
constexpr std::string_view kDistanceMeaning =
    "Distance of the camera from the ball's centre in radii of the ball. null = infinitely far.";
constexpr std::string_view kMirroredMeaning =
    "Left and right are exchanged: what a camera sees on a real ball, +X to the right of +Z.";

// Names with "auto" in front; position 0 = none.
template <typename T>
size_t position(const std::optional<T>& member) {
  return member ? static_cast<size_t>(*member) + 1 : 0;
}
template <typename T>
void assign(std::optional<T>* member, size_t index) {
  if (index == 0)
    member->reset();
  else
    *member = static_cast<T>(index - 1);
}

std::vector<std::string_view> source_names() {
  std::vector<std::string_view> names = {"auto"};
  for (size_t kind = 0; kind < kCubeFaces; ++kind) names.push_back(layout_product_name(kind));
  return names;
}

// A group that says nothing new stands in no canonical spec.
template <typename T>
ParameterGroup source_group() {
  return {
      "/parameters/source",
      {{"layout",
        NameMember{source_names(),
                   [](const Spec& s) { return position(parameters<T>(s).source.layout); },
                   [](Spec& s, size_t i) { assign(&parameters<T>(s).source.layout, i); }},
        {},
        false,
        "Layout of the environment's file. auto = the one its envmap attribute names, else "
        "latlong, exactly twice as wide as high."},
       {"texel_convention",
        NameMember{{"auto", "half_texel", "openexr"},
                   [](const Spec& s) { return position(parameters<T>(s).source.texel_convention); },
                   [](Spec& s, size_t i) { assign(&parameters<T>(s).source.texel_convention, i); }},
        {},
        false,
        "Texel centres at (i + 1/2)/N or, by OpenEXR's envmap attribute, at i/(N - 1). auto = "
        "openexr when the attribute names the layout. openexr goes with latlong and cube_strip."},
       {"distance",
        +[](Spec& s) -> std::optional<double>& { return parameters<T>(s).source.distance; },
        kDistance, false, kDistanceMeaning},
       {"mirrored",
        +[](Spec& s) -> bool& { return parameters<T>(s).source.mirrored; },
        {},
        false,
        kMirroredMeaning},
       {"face_orientation",
        NameMember{{"openexr", "opengl"},
                   [](const Spec& s) {
                     return static_cast<size_t>(parameters<T>(s).source.face_orientation);
                   },
                   [](Spec& s, size_t i) {
                     parameters<T>(s).source.face_orientation = FaceOrientation(i);
                   }},
        {},
        false,
        "How the faces of a cube_strip or of six files are turned. openexr: as OpenEXR's cube. "
        "opengl: as the six images that OpenGL, Direct3D and engines on them look up, whose world "
        "is (-x, y, z); px then shows what lies at -X of ours. Crosses are the same in either."},
       {"strict",
        +[](Spec& s) -> bool& { return parameters<T>(s).source.strict; },
        {},
        false,
        "NaN, infinite and negative pixels are refused with their counts; otherwise they are set "
        "to 0 and counted."}},
      [](const Spec& s) { return !(parameters<T>(s).source == SourceParameters{}); },
      nullptr};
}

template <typename T>
ParameterGroup rotation_group() {
  return {"/parameters/rotation",
          {{"quaternion",
            NumbersMember{[](Spec& s) -> std::vector<double>& {
                            return parameters<T>(s).rotation.quaternion;
                          },
                          4, 4},
            {-1e6, 1e6},
            false,
            "x, y, z, w of any length above zero: the environment is turned so that what stood at "
            "d stands at R d. Instead of yaw_degrees."},
           {"yaw_degrees",
            +[](Spec& s) -> double& { return parameters<T>(s).rotation.yaw_degrees; },
            {-360, 360},
            false,
            "Turn about +Y, counter-clockwise seen from above: 90 turns +Z into +X."}},
          [](const Spec& s) { return !(parameters<T>(s).rotation == RotationParameters{}); },
          nullptr};
}

template <typename T>
ParameterGroup cubes_group(std::string_view meaning) {
  return {"/parameters/cubes",
          {{"face_orientation",
            NameMember{{"openexr", "opengl"},
                       [](const Spec& s) {
                         return static_cast<size_t>(parameters<T>(s).cubes.face_orientation);
                       },
                       [](Spec& s, size_t i) {
                         parameters<T>(s).cubes.face_orientation = FaceOrientation(i);
                       }},
            {},
            false,
            meaning}},
          [](const Spec& s) { return !(parameters<T>(s).cubes == CubeParameters{}); },
          nullptr};
}

template <size_t Product>
LayoutOutput& output(Spec& spec) {
  return *parameters<Maps>(spec).layouts[Product];
}

template <size_t Product>
ParameterRow size_row(std::string_view name, Range range, std::string_view meaning) {
  return {name, +[](Spec& s) -> int& { return output<Product>(s).size; }, range, false, meaning};
}

template <size_t Product>
ParameterRow convention_row() {
  return {"texel_convention",
          NameMember{{"half_texel", "openexr"},
                     [](const Spec& s) {
                       return static_cast<size_t>(
                           parameters<Maps>(s).layouts[Product]->texel_convention);
                     },
                     [](Spec& s, size_t i) {
                       output<Product>(s).texel_convention = static_cast<TexelConvention>(i);
                     }},
          {},
          false,
          "Texel centres at (i + 1/2)/N, as engines sample, or at i/(N - 1) with OpenEXR's envmap "
          "attribute (no cube in OpenGL's orientation carries it)."};
}

template <size_t Product>
std::vector<ParameterRow> rows_of() {
  constexpr LayoutKind kind = static_cast<LayoutKind>(Product);
  constexpr std::string_view kWidth =
      "Texels in width, even; half as many rows. Cost grows with "
      "its square.";
  if constexpr (Product == kCubeFaces || kind == LayoutKind::horizontal_cross ||
                kind == LayoutKind::vertical_cross) {
    return {size_row<Product>("size", {1, 2048}, "Texels along a face's side.")};
  } else if constexpr (kind == LayoutKind::cube_strip) {
    return {size_row<Product>("size", {1, 2048}, "Texels along a face's side."),
            convention_row<Product>()};
  } else if constexpr (kind == LayoutKind::latlong) {
    return {size_row<Product>("width", {2, 8192}, kWidth), convention_row<Product>()};
  } else if constexpr (kind == LayoutKind::cylinder_equal_area) {
    return {size_row<Product>("width", {2, 8192}, kWidth)};
  } else if constexpr (kind == LayoutKind::cylinder) {
    return {size_row<Product>("width", {2, 8192}, "Texels in width, even."),
            {"height",
             +[](Spec& s) -> std::optional<int>& { return output<Product>(s).height; },
             {1, 4096},
             false,
             "Rows; null = half the width. Latitudes up to atan(pi height / width) are covered."}};
  } else {
    std::vector<ParameterRow> rows = {
        size_row<Product>("size", {2, 4096}, "Texels along the image's side.")};
    if constexpr (kind == LayoutKind::mirror_ball) {
      rows.push_back(
          {"distance",
           +[](Spec& s) -> std::optional<double>& { return output<Product>(s).distance; },
           kDistance, false, kDistanceMeaning});
    }
    if constexpr (kind == LayoutKind::mirror_ball || kind == LayoutKind::angular) {
      rows.push_back({"mirrored",
                      +[](Spec& s) -> bool& { return output<Product>(s).mirrored; },
                      {},
                      false,
                      kMirroredMeaning});
    }
    return rows;
  }
}

constexpr std::array<std::string_view, kLayoutProducts> kPaths = {
    "/parameters/layouts/latlong",          "/parameters/layouts/cube_strip",
    "/parameters/layouts/horizontal_cross", "/parameters/layouts/vertical_cross",
    "/parameters/layouts/angular",          "/parameters/layouts/mirror_ball",
    "/parameters/layouts/octahedral",       "/parameters/layouts/equal_area_octahedral",
    "/parameters/layouts/hemisphere",       "/parameters/layouts/hemisphere_equal_area",
    "/parameters/layouts/cylinder",         "/parameters/layouts/cylinder_equal_area",
    "/parameters/layouts/cube_faces"};

template <size_t Product>
ParameterGroup layout_group() {
  return {kPaths[Product], rows_of<Product>(),
          [](const Spec& s) { return parameters<Maps>(s).layouts[Product].has_value(); },
          [](Spec& s) { parameters<Maps>(s).layouts[Product] = default_layout_output(Product); }};
}

}  // namespace

ParameterGroup maps_source_group() {
  return source_group<EnvironmentMapsParameters>();
}
ParameterGroup probes_source_group() {
  return source_group<ProbesParameters>();
}
ParameterGroup maps_rotation_group() {
  return rotation_group<EnvironmentMapsParameters>();
}
ParameterGroup probes_rotation_group() {
  return rotation_group<ProbesParameters>();
}

ParameterGroup maps_cubes_group() {
  return cubes_group<EnvironmentMapsParameters>(
      "How the faces of every cube are written: under layouts, of prefilter, sheen and irradiance. "
      "openexr: as OpenEXR's cube. opengl: as OpenGL, Direct3D, Vulkan and engines on them look "
      "up, whose world is (-x, y, z); px then shows what lies at -X of ours. Crosses are the same "
      "in either.");
}
ParameterGroup probes_cubes_group() {
  return cubes_group<ProbesParameters>(
      "How the faces of both cubes of a probe are written. openexr: as OpenEXR's cube. opengl: as "
      "OpenGL, Direct3D, Vulkan and engines on them look up, whose world is (-x, y, z); +X then "
      "shows what lies at -X of ours.");
}

std::vector<ParameterGroup> layout_groups() {
  std::vector<ParameterGroup> groups = {{"/parameters/layouts",
                                         {},
                                         [](const Spec& s) {
                                           for (const auto& order : parameters<Maps>(s).layouts)
                                             if (order) return true;
                                           return false;
                                         },
                                         nullptr}};
  [&]<size_t... Product>(std::index_sequence<Product...>) {
    (groups.push_back(layout_group<Product>()), ...);
  }
  (std::make_index_sequence<kLayoutProducts>{});
  return groups;
}

}  // namespace lightkiln

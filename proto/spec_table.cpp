#include "proto/spec_table.h"

#include <algorithm>
#include <utility>

#include "core/environment/charlie_lobe.h"
#include "proto/spec_harmonics.h"
#include "proto/spec_layouts.h"

namespace lightkiln {
namespace {

using Ao = AmbientOcclusionParameters;
using Maps = EnvironmentMapsParameters;
using Probes = ProbesParameters;

constexpr double kWhole64 = 18446744073709551615.0;
constexpr Range kPositive{0, 1e300, true};

ParameterGroup accuracy_group() {
  return {
      "/accuracy",
      {{"target_error",
        +[](Spec& s) -> std::optional<double>& { return s.accuracy.target_error; },
        {0, 1, true},
        false,
        "95 % confidence half-width per element: absolute for ambient occlusion, relative to "
        "the job's mean luminance for radiance. null = the kind's default. Halving it costs "
        "2.6 to 4 times the time."},
       {"max_samples",
        +[](Spec& s) -> std::optional<uint64_t>& { return s.accuracy.max_samples; },
        {64, 1048576},
        false,
        "Samples per element or texel at the most, rounded up to a power of two. null = "
        "65536."},
       {"max_seconds", +[](Spec& s) -> std::optional<double>& { return s.accuracy.max_seconds; },
        kPositive, false,
        "Seconds that baking may be predicted to take; it pins a sample count before baking "
        "starts. null = no limit."},
       {"check_texels",
        +[](Spec& s) -> int& { return s.accuracy.check_texels; },
        {0, 4096},
        false,
        "Texels, coefficients or entries of each output that are held against a slow "
        "double-precision twin; 0 = none. One costs a pass over the map."}}};
}

// The group with the rows refused that a kind has no use for.
ParameterGroup without(ParameterGroup group, std::initializer_list<std::string_view> names) {
  for (ParameterRow& row : group.rows)
    row.refused = std::find(names.begin(), names.end(), row.name) != names.end();
  return group;
}

ParameterGroup root_group() {
  return {"",
          {{"seed",
            +[](Spec& s) -> uint64_t& { return s.seed; },
            {0, kWhole64},
            false,
            "Random streams are a pure function of it: equal specs give equal bytes."}}};
}

KindTable ambient_occlusion_table() {
  ParameterGroup own = {
      "/parameters",
      {{"target",
        NameMember{{"vertices"},
                   [](const Spec& s) { return static_cast<size_t>(parameters<Ao>(s).target); },
                   [](Spec& s, size_t i) { parameters<Ao>(s).target = AoTarget(i); }},
        {},
        false,
        "Where openness is wanted."},
       {"max_distance",
        +[](Spec& s) -> std::optional<double>& { return parameters<Ao>(s).max_distance; },
        kPositive, false,
        "World units. null = infinite. Shorter is cheaper. The falloffs linear, quadratic and "
        "smooth need one."},
       {"falloff",
        NameMember{{"none", "linear", "quadratic", "smooth", "exponential"},
                   [](const Spec& s) { return static_cast<size_t>(parameters<Ao>(s).falloff); },
                   [](Spec& s, size_t i) { parameters<Ao>(s).falloff = Falloff(i); }},
        {},
        false,
        "mu of a hit at distance d, with t = d / max_distance: none 0, linear t, quadratic t^2, "
        "smooth 3t^2 - 2t^3, exponential 1 - exp(-d / falloff_distance)."},
       {"falloff_distance",
        +[](Spec& s) -> std::optional<double>& { return parameters<Ao>(s).falloff_distance; },
        kPositive, false, "World units. Required by the falloff exponential, refused otherwise."},
       {"distribution",
        NameMember{
            {"cosine", "uniform"},
            [](const Spec& s) { return static_cast<size_t>(parameters<Ao>(s).distribution); },
            [](Spec& s, size_t i) { parameters<Ao>(s).distribution = Distribution(i); }},
        {},
        false,
        "How directions of the hemisphere are weighted."}}};
  return {Kind::ambient_occlusion,
          "Openness at every vertex of a scene: 1 = open sky.",
          {{"scene", &Spec::scene, true, false}},
          {root_group(), without(accuracy_group(), {"check_texels"}), own}};
}

ParameterGroup irradiance_group() {
  return {"/parameters/irradiance",
          {{"size",
            +[](Spec& s) -> int& { return parameters<Maps>(s).irradiance->size; },
            {1, 1024},
            false,
            "Texels along a face's side. Cost grows with its square."},
           {"method",
            NameMember{{"exact", "harmonics"},
                       [](const Spec& s) {
                         return static_cast<size_t>(parameters<Maps>(s).irradiance->method);
                       },
                       [](Spec& s, size_t i) {
                         parameters<Maps>(s).irradiance->method = IrradianceMethod(i);
                       }},
            {},
            false,
            "exact: the whole map under the clamped cosine. harmonics: its first bands alone, as "
            "engines keep them, with what that leaves out."},
           {"bands",
            +[](Spec& s) -> std::optional<int>& { return parameters<Maps>(s).irradiance->bands; },
            Range{1, 33}, false, "Of the method harmonics; null = 3. Refused by exact."}},
          [](const Spec& s) { return parameters<Maps>(s).irradiance.has_value(); },
          [](Spec& s) { parameters<Maps>(s).irradiance.emplace(); }};
}

// The chains are alike but for their lobe and the lowest roughness that it has.
template <auto kChain>
ParameterGroup chain_group(std::string_view path, double least_roughness) {
  return {path,
          {{"size",
            +[](Spec& s) -> int& { return (parameters<Maps>(s).*kChain)->size; },
            {8, 2048},
            false,
            "Texels along a face's side of level 0, a power of two."},
           {"levels",
            +[](Spec& s) -> int& { return (parameters<Maps>(s).*kChain)->levels; },
            {2, 12},
            false,
            "Levels; each halves the size. The last level has at least one texel."},
           {"roughness_scale",
            NameMember{{"linear", "filament", "unity", "custom"},
                       [](const Spec& s) {
                         return static_cast<size_t>((parameters<Maps>(s).*kChain)->roughness_scale);
                       },
                       [](Spec& s, size_t i) {
                         (parameters<Maps>(s).*kChain)->roughness_scale = RoughnessScale(i);
                       }},
            {},
            false,
            "The level, as a share of the last, that an engine looks up for roughness r: linear r, "
            "filament r (2 - r), unity r (1.7 - 0.7 r); custom: the list roughness. A level of low "
            "roughness costs most."},
           {"roughness",
            NumbersMember{[](Spec& s) -> std::vector<double>& {
                            return (parameters<Maps>(s).*kChain)->roughness;
                          },
                          0, 12},
            {least_roughness, 1},
            false,
            "Of roughness_scale custom: one a level, in any order. Empty and refused otherwise."},
           {"packaging",
            NameMember{
                {"files", "mip_mapped"},
                [](const Spec& s) {
                  return static_cast<size_t>((parameters<Maps>(s).*kChain)->packaging);
                },
                [](Spec& s, size_t i) { (parameters<Maps>(s).*kChain)->packaging = Packaging(i); }},
            {},
            false,
            "files: one OpenEXR file a level. mip_mapped: one file of all levels."}},
          [](const Spec& s) { return (parameters<Maps>(s).*kChain).has_value(); },
          [](Spec& s) { (parameters<Maps>(s).*kChain).emplace(); }};
}

ParameterGroup dfg_group() {
  return {"/parameters/dfg",
          {{"size",
            +[](Spec& s) -> int& { return parameters<Maps>(s).dfg->size; },
            {8, 1024},
            false,
            "Texels a side of the split-sum table."},
           {"multiple_scattering",
            +[](Spec& s) -> bool& { return parameters<Maps>(s).dfg->multiple_scattering; },
            {},
            false,
            "false: R scale of F0, G bias. true: R bias, G their sum E, from which reflected = (F0 "
            "(G - R) + R) (1 + F0 (1/G - 1)) gives back what single scattering loses."},
           {"charlie",
            +[](Spec& s) -> bool& { return parameters<Maps>(s).dfg->charlie; },
            {},
            false,
            "B: the albedo of Charlie sheen; 0 otherwise."}},
          [](const Spec& s) { return parameters<Maps>(s).dfg.has_value(); },
          [](Spec& s) { parameters<Maps>(s).dfg.emplace(); }};
}

ParameterGroup sun_group() {
  return {"/parameters/sun",
          {{"max_angular_radius_degrees",
            +[](Spec& s) -> double& { return parameters<Maps>(s).sun->max_angular_radius_degrees; },
            {0, 10, true},
            false,
            "How far the source may reach from its centre. A wider one stays in the map."},
           {"min_contrast",
            +[](Spec& s) -> double& { return parameters<Maps>(s).sun->min_contrast; },
            {1, 1000},
            false,
            "How many times as bright as the level at which it stands off its surroundings the "
            "source's brightest texel must be."}},
          [](const Spec& s) { return parameters<Maps>(s).sun.has_value(); },
          [](Spec& s) { parameters<Maps>(s).sun.emplace(); }};
}

ParameterGroup light_set_group() {
  return {"/parameters/light_set",
          {{"lights",
            +[](Spec& s) -> std::optional<int>& { return parameters<Maps>(s).light_set->lights; },
            {1, 256},
            false,
            "Directional lights. null = the fewest of 1, 2, 4, .. 256 whose irradiance has an rms "
            "error of at most target_error; 256 if none has."}},
          [](const Spec& s) { return parameters<Maps>(s).light_set.has_value(); },
          [](Spec& s) { parameters<Maps>(s).light_set.emplace(); }};
}

ParameterGroup asset_group() {
  return {
      "/parameters/asset",
      {{"size",
        +[](Spec& s) -> int& { return parameters<Maps>(s).asset->size; },
        {32, 1024},
        false,
        "Texels along a face's side of level 0, a power of two; levels halve it down to 16."},
       {"roughness",
        NameMember{
            {"linear", "babylon"},
            [](const Spec& s) { return static_cast<size_t>(parameters<Maps>(s).asset->roughness); },
            [](Spec& s, size_t i) { parameters<Maps>(s).asset->roughness = AssetRoughness(i); }},
        {},
        false,
        "Roughness of the levels. linear: from 0 to 1 in equal steps, as the extension's text "
        "says. babylon: what Babylon.js looks up, size^((level / (levels - 1) - 1) / 2)."},
       asset_window_row()},
      [](const Spec& s) { return parameters<Maps>(s).asset.has_value(); },
      [](Spec& s) { parameters<Maps>(s).asset.emplace(); }};
}

KindTable environment_maps_table() {
  std::vector<ParameterGroup> groups = {without(root_group(), {"seed"}),
                                        without(accuracy_group(), {"max_samples", "max_seconds"}),
                                        {"/parameters", {}}};
  groups.push_back(maps_source_group());
  groups.push_back(maps_rotation_group());
  groups.push_back(maps_cubes_group());
  groups.push_back(maps_sh_group());
  groups.push_back(irradiance_group());
  groups.push_back(chain_group<&Maps::prefilter>("/parameters/prefilter", 0));
  groups.push_back(chain_group<&Maps::sheen>("/parameters/sheen", kMinSheenRoughness));
  groups.push_back(dfg_group());
  groups.push_back(sun_group());
  groups.push_back(light_set_group());
  groups.push_back(
      {"/parameters/spectrum",
       {{"bands",
         +[](Spec& s) -> int& { return parameters<Maps>(s).spectrum->bands; },
         {1, 129},
         false,
         "Rows of the table. Advice reaches to 129 bands, whatever is listed; all cost the same."}},
       [](const Spec& s) { return parameters<Maps>(s).spectrum.has_value(); },
       [](Spec& s) { parameters<Maps>(s).spectrum.emplace(); }});
  groups.push_back(asset_group());
  for (ParameterGroup& group : layout_groups()) groups.push_back(std::move(group));
  return {Kind::environment_maps,
          "Coefficients, irradiance, prefiltered chains and the DFG table of an environment "
          "map, and the map in any layout.",
          {{"environment", &Spec::environment, true, true}},
          groups};
}

KindTable probes_table() {
  std::vector<ParameterGroup> groups = {root_group(), without(accuracy_group(), {"check_texels"})};
  groups.push_back(
      {"/parameters",
       {{"positions",
         +[](Spec& s) -> std::vector<Vec3d>& { return parameters<Probes>(s).positions; },
         {1, 10000},
         true,
         "Where the probes stand: [x, y, z] each, in world units."},
        {"max_bounces",
         +[](Spec& s) -> std::optional<int>& { return parameters<Probes>(s).max_bounces; },
         {0, 64},
         false,
         "Diffuse bounces. 0 = only light that surfaces emit or the environment sends straight to "
         "the probe. null = the fewest whose truncation bound stays under half the ordered "
         "error."}}});
  groups.push_back(probes_source_group());
  groups.push_back(probes_rotation_group());
  groups.push_back(probes_cubes_group());
  groups.push_back({"/parameters/cubemap",
                    {{"size",
                      +[](Spec& s) -> int& { return parameters<Probes>(s).cubemap.size; },
                      {1, 512},
                      false,
                      "Texels along a face's side. Cost grows with its square."}}});
  groups.push_back(probes_sh_group());
  return {Kind::probes,
          "A radiance cubemap, coefficients, a distance cube and validity at each listed position.",
          {{"scene", &Spec::scene, true, false}, {"environment", &Spec::environment, false, true}},
          groups};
}

}  // namespace

const KindTable& kind_table(Kind kind) {
  static const KindTable tables[] = {ambient_occlusion_table(), environment_maps_table(),
                                     probes_table()};
  return tables[static_cast<size_t>(kind)];
}

Spec empty_spec(Kind kind) {
  Spec spec;
  switch (kind) {
    case Kind::ambient_occlusion:
      spec.parameters = AmbientOcclusionParameters{};
      break;
    case Kind::environment_maps:
      spec.parameters = EnvironmentMapsParameters{};
      break;
    case Kind::probes:
      spec.parameters = ProbesParameters{};
      break;
  }
  return spec;
}

}  // namespace lightkiln

#include "proto/spec_harmonics.h"

#include <type_traits>
#include <utility>

namespace lightkiln {
namespace {

using Maps = EnvironmentMapsParameters;
using Probes = ProbesParameters;

template <typename T, typename S>
auto& sh_of(S& spec) {
  if constexpr (std::is_same_v<T, Maps>)
    return *parameters<Maps>(spec).sh;
  else
    return parameters<Probes>(spec).sh;
}

const std::vector<std::string_view>& window_names() {
  static const std::vector<std::string_view> names = {"none", "hann", "lanczos", "minimal"};
  return names;
}

// What coefficients of maps and of probes have alike.
template <typename T>
std::vector<ParameterRow> common_rows(Range bands) {
  return {
      {"bands", +[](Spec& s) -> int& { return sh_of<T>(s).bands; }, bands, false,
       "Bands of spherical harmonics; bands squared coefficients. Cost grows with their number."},
      {"window",
       NameMember{window_names(),
                  [](const Spec& s) { return static_cast<size_t>(sh_of<T>(s).window); },
                  [](Spec& s, size_t i) { sh_of<T>(s).window = ShWindow(i); }},
       {},
       false,
       "Factors by band against ringing. minimal is the smallest filter 1 / (1 + lambda l^2 "
       "(l+1)^2) whose reconstruction is nowhere negative; what it takes of energy and contrast "
       "is stated."},
      {"window_quantity",
       NameMember{{"radiance", "irradiance"},
                  [](const Spec& s) { return static_cast<size_t>(sh_of<T>(s).window_quantity); },
                  [](Spec& s, size_t i) { sh_of<T>(s).window_quantity = ShQuantity(i); }},
       {},
       false,
       "The reconstruction that the window is for and is judged by. radiance asks for more. "
       "Refused without a window."}};
}

}  // namespace

ParameterGroup maps_sh_group() {
  std::vector<std::string_view> targets;
  for (const ShTarget target : kShTargets) targets.push_back(sh_target_name(target));
  std::vector<ParameterRow> rows = common_rows<Maps>({1, 129});
  rows.push_back({"zh3",
                  +[](Spec& s) -> bool& { return sh_of<Maps>(s).zh3; },
                  {},
                  false,
                  "Linear bands with a zonal third band as well (ZH3), fitted and guessed, before "
                  "any window."});
  rows.push_back(
      {"exports",
       NameSetMember{std::move(targets),
                     [](Spec& s) -> uint32_t& { return sh_of<Maps>(s).exports; }},
       {},
       false,
       "Files of the first three bands as these engines hold them, with a self-test in the "
       "engine's axes."});
  return {"/parameters/sh", std::move(rows),
          [](const Spec& s) { return parameters<Maps>(s).sh.has_value(); },
          [](Spec& s) { parameters<Maps>(s).sh.emplace(); }};
}

ParameterGroup probes_sh_group() {
  return {"/parameters/sh", common_rows<Probes>({1, 33})};
}

ParameterRow asset_window_row() {
  return {"window",
          NameMember{
              window_names(),
              [](const Spec& s) { return static_cast<size_t>(parameters<Maps>(s).asset->window); },
              [](Spec& s, size_t i) { parameters<Maps>(s).asset->window = ShWindow(i); }},
          {},
          false,
          "Factors by band against ringing of the irradiance that the coefficients give, as of sh; "
          "what they take of energy and contrast is stated."};
}

}  // namespace lightkiln

#include "core/bake/spec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>

#include "core/bake/spec_checker.h"

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

void check_faces(const InputRef& input, const std::string& pointer, SpecChecker& checker) {
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

void check_input(const InputRef& input, const std::string& pointer, SpecChecker& checker) {
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
                   SpecChecker& checker) {
  if (!input)
    checker.fault("/inputs/" + name, "missing",
                  std::string(kind_name(kind)) + " needs the input \"" + name + "\".");
}

void refuse_input(const std::optional<InputRef>& input, const std::string& name, Kind kind,
                  SpecChecker& checker) {
  if (input)
    checker.fault("/inputs/" + name, "conflict",
                  std::string(kind_name(kind)) + " does not use the input \"" + name + "\".");
}

void check_ambient_occlusion(const AmbientOcclusionParameters& p, SpecChecker& checker) {
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

// What can be held is told by the number of positions, whose cubes the other parameters size.
void check_probe_bytes(const ProbesParameters& p, SpecChecker& checker) {
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

void check_probes(const ProbesParameters& p, SpecChecker& checker) {
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

void check_accuracy(const Accuracy& accuracy, SpecChecker& checker) {
  if (accuracy.target_error && !(*accuracy.target_error > 0 && *accuracy.target_error <= 1))
    checker.fault("/accuracy/target_error", "range", "target_error must be above 0 and at most 1.");
  if (accuracy.max_samples)
    checker.between<uint64_t>(*accuracy.max_samples, 64, 1048576, "/accuracy/max_samples",
                              "max_samples");
  checker.positive(accuracy.max_seconds, "/accuracy/max_seconds", "max_seconds");
  checker.between(accuracy.check_texels, 0, 4096, "/accuracy/check_texels", "check_texels");
}

// What is sampled is measured by its own samples.
void refuse_checks(const Spec& spec, SpecChecker& checker) {
  if (spec.accuracy.check_texels != Accuracy::kDefaultCheckTexels)
    checker.fault("/accuracy/check_texels", "conflict",
                  std::string("check_texels belongs to environment_maps; ") +
                      kind_name(spec.kind()) + " states an error bar with every element.");
}

// Environment maps are sums and transforms: nothing is drawn at random, so there are no samples to
// limit, no seed to vary and no sample count that a time limit could pin.
void refuse_sampling(const Spec& spec, SpecChecker& checker) {
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
  SpecChecker checker;
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

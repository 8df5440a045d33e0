#pragma once

// What a client orders. Every field states its default, unit, range, what zero or "none" means, and
// what raising it costs. The same names, defaults and ranges stand in proto/openapi.json and in the
// field tables of proto/json; a test holds the three together. Orders of environment maps are in
// map_orders.h, what they share with probes in layout_orders.h.

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/bake/map_orders.h"
#include "core/base/math.h"

namespace lightkiln {

enum class Falloff {
  none,         // a hit counts fully at any distance: mu = 0
  linear,       // mu = t, t = distance / max_distance
  quadratic,    // mu = t^2
  smooth,       // mu = 3 t^2 - 2 t^3
  exponential,  // mu = 1 - exp(-distance / falloff_distance)
};
enum class Distribution { cosine, uniform };
enum class AoTarget { vertices };

struct AmbientOcclusionParameters {
  AoTarget target = AoTarget::vertices;
  // World units, > 0. None = infinite. Shorter is cheaper. linear, quadratic and smooth need one.
  std::optional<double> max_distance;
  Falloff falloff = Falloff::none;
  // World units, > 0. Required by `exponential`, refused otherwise.
  std::optional<double> falloff_distance;
  Distribution distribution = Distribution::cosine;
};

struct CubemapOutput {
  int size = 64;  // texels a face side, 1..512; cost grows with size^2
};

struct ProbeShOutput {
  int bands = 3;  // 1..33; cost grows with bands^2
  // As of ShOutput; `minimal` takes up to a tenth of a second a probe at 33 bands.
  ShWindow window = ShWindow::none;
  ShQuantity window_quantity = ShQuantity::irradiance;
};

struct ProbesParameters {
  SourceParameters source;      // of the environment
  RotationParameters rotation;  // of the environment
  // World units, 1..10000 positions; fewer where cubes are large: see kMostProbeBytes.
  std::vector<Vec3d> positions;
  CubemapOutput cubemap;
  CubeParameters cubes;
  ProbeShOutput sh;
  // Diffuse bounces, 0..64: 0 = only light that surfaces emit or the environment sends directly to
  // the probe. None = the fewest whose truncation bound stays under half the ordered error.
  std::optional<int> max_bounces;
};

enum class Kind { ambient_occlusion, environment_maps, probes };
inline constexpr Kind kKinds[] = {Kind::ambient_occlusion, Kind::environment_maps, Kind::probes};
const char* kind_name(Kind kind);

// A blob by its digest "sha256:<64 hex>", a .gltf with the blobs that its URIs name, or
// (environment alone) the six faces of a cube as six blobs.
struct InputRef {
  std::string blob;                                            // "" = faces
  std::vector<std::pair<std::string, std::string>> resources;  // (URI, digest), sorted by URI
  std::vector<std::string> faces = {};  // +X -X +Y -Y +Z -Z as in kCubeFaceNames; empty = a blob
};

struct Accuracy {
  // 95 % confidence half-width per element: absolute for ambient occlusion; for a probe that of its
  // cube, the root mean square of its texels' errors over the sphere, relative to the job's mean
  // luminance. > 0, <= 1. None = the kind's default (0.02, 0.001, 0.05). Halving
  // it costs about 2.6 times the time where shadows have edges, 4 times where noise is independent.
  std::optional<double> target_error;
  // Samples per element and texel at the most, rounded up to a power of two; 64..1048576. None =
  // 65536. Refused for environment maps, which take no samples.
  std::optional<uint64_t> max_samples;
  // CPU-independent promise: wall seconds that the plan may predict for baking, > 0. It pins a
  // sample count before baking starts. None = no limit. Refused for environment maps.
  std::optional<double> max_seconds;
  // Texels, coefficients or entries of each output that are held against a slow double-precision
  // twin, 0..4096; 0 = none. One costs a pass over the map. Environment maps only: sampled results
  // carry an error bar of their own.
  int check_texels = kDefaultCheckTexels;
  static constexpr int kDefaultCheckTexels = 4;
};

struct Spec {
  std::optional<InputRef> scene;        // ambient_occlusion and probes: required
  std::optional<InputRef> environment;  // environment_maps: required; probes: optional (black)
  std::variant<AmbientOcclusionParameters, EnvironmentMapsParameters, ProbesParameters> parameters;
  Accuracy accuracy;
  uint64_t seed = 0;  // random streams are a pure function of it; 0 alone for environment maps

  Kind kind() const { return static_cast<Kind>(parameters.index()); }
};

double default_target_error(Kind kind);
double target_error(const Spec& spec);
// Of kinds that take samples.
uint64_t max_samples(const Spec& spec);

// Limits of the engine, the same under every operator, so that equal orders have equal results.
// Rays that one element may cost, whatever was ordered.
inline constexpr uint64_t kMostRaysPerElement = 1u << 26;
// Bytes that all probes of an order may hold in memory: see probe_bytes.
inline constexpr uint64_t kMostProbeBytes = 1u << 30;
// One probe: 16 bytes a texel of its cube (radiance and distance), 24 a coefficient of its
// harmonics.
uint64_t probe_bytes(const ProbesParameters& parameters);

// A fault of a spec at a JSON pointer relative to the spec's root.
struct SpecFault {
  std::string pointer;
  std::string code;  // missing | unknown | type | range | too_large | conflict | duplicate | syntax
  std::string message;          // one sentence: what is wrong and what is allowed
  std::string allowed = {};     // the values or the range that would do; "" = not said
  std::string suggestion = {};  // the nearest known name; "" = none is near
};

// Every fault that can be told without opening a file; empty when the spec can be ordered.
std::vector<SpecFault> validate(const Spec& spec);

// What an operator grants; never part of a spec.
struct Grants {
  int threads = 0;  // 0 = one per processor
  // What the ray tracer's own structures may take: past it a job ends with out_of_memory instead of
  // its process. It bounds nothing else; the process needs a limit of its own. 0 = no limit.
  uint64_t max_memory_bytes = 0;
  double chunk_seconds = 4.0;  // work aimed at per chunk
};

}  // namespace lightkiln

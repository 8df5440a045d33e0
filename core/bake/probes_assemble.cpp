#include <algorithm>
#include <cstdio>
#include <string>

#include "core/bake/probes_state.h"
#include "core/image/exr.h"

namespace lightkiln {

namespace {

// Half's own rounding, 2^-11 of a value, is left to orders that it cannot spoil.
constexpr double kHalfIsEnough = 0.002;

std::string artifact_name(uint64_t probe, const char* what) {
  char name[64];
  std::snprintf(name, sizeof name, "probe_%04llu_%s.exr", static_cast<unsigned long long>(probe),
                what);
  return name;
}

// The cube's texel centres lie at (i + 1/2)/N, not on the borders as the standard attribute
// `envmap` says, so the layout is told in words of our own.
std::map<std::string, std::string> attributes(const Vec3d& position, const char* quantity,
                                              FaceOrientation faces) {
  char place[96];
  std::snprintf(place, sizeof place, "%.17g %.17g %.17g", position.x, position.y, position.z);
  std::map<std::string, std::string> words = {
      {"lightkiln.layout", faces == FaceOrientation::openexr
                               ? "cube: +X -X +Y -Y +Z -Z from top to bottom"
                               : describe_strip(faces)},
      {"lightkiln.position", place},
      {"lightkiln.quantity", quantity},
      {"lightkiln.texel_convention", "half_texel"}};
  tell_faces(faces, &words);
  return words;
}

ExrWriteOptions options_of(ExrPixelType type, int threads,
                           std::map<std::string, std::string> words) {
  ExrWriteOptions options;
  options.pixel_type = type;
  options.attributes = std::move(words);
  options.threads = threads;
  return options;
}

Image stacked_cube(int size, int channels, std::vector<float> pixels) {
  Image image;
  image.width = size;
  image.height = 6 * size;
  image.channels = channels;
  image.pixels = std::move(pixels);
  return image;
}

ProbeDocument describe(const ProbeResult& result, const Vec3d& position) {
  ProbeDocument document;
  document.index = result.index;
  document.position = position;
  document.status = result.surroundings.status;
  document.backface_share = result.surroundings.backface_share;
  document.distance_mean = result.surroundings.distance_mean;
  document.distance_min = result.surroundings.distance_min;
  document.hit_share = result.surroundings.hit_share;
  document.error = result.error;
  document.accuracy = result.accuracy;
  document.sh.sh = result.sh;
  document.sh.selftest = make_selftest(result.sh);
  document.sh.error = result.sh_error;
  if (result.window.window != ShWindow::none) document.sh_window = result.window;
  document.radiance_artifact = artifact_name(result.index, "radiance");
  document.distance_artifact = artifact_name(result.index, "distance");
  return document;
}

}  // namespace

Assembly probes_assemble(ProbesState& state, const Plan& plan, std::span<const ChunkResult> chunks,
                         Progress& progress) {
  const ProbesParameters& parameters = state.parameters();
  const double target = target_error(state.spec);
  const ExrPixelType type = target < kHalfIsEnough ? ExrPixelType::float32 : ExrPixelType::half;
  Assembly assembly;
  ProbesDocument document;
  document.cubemap_size = parameters.cubemap.size;
  const FaceOrientation faces = document.faces = parameters.cubes.face_orientation;
  std::vector<ChunkReport> reports;
  for (size_t i = 0; i < chunks.size(); ++i) {
    ByteReader reader(chunks[i].bytes);
    for (uint64_t p = 0; p < plan.chunks[i].count; ++p) {
      ProbeResult result = read_probe(reader, parameters, plan.chunks[i].first + p);
      const Vec3d& position = parameters.positions.at(result.index);
      document.probes.push_back(describe(result, position));
      const ProbeDocument& described = document.probes.back();
      const int size = parameters.cubemap.size, threads = state.grants.threads;
      add_image(described.radiance_artifact,
                ordered_faces(stacked_cube(size, 3, std::move(result.radiance)), faces),
                options_of(type, threads, attributes(position, "radiance", faces)), &assembly);
      add_image(
          described.distance_artifact,
          ordered_faces(stacked_cube(size, 1, std::move(result.distance)), faces),
          options_of(
              ExrPixelType::float32, threads,
              attributes(position, "distance to the nearest surface, world units; 0 = nothing hit",
                         faces)),
          &assembly);
      progress.update(static_cast<double>(document.probes.size()) /
                      static_cast<double>(plan.elements));
    }
    if (!reader.at_end())
      throw Error(ErrorCode::internal, "A chunk's bytes go on after its last probe.");
    reports.push_back(chunks[i].report);
  }
  assembly.accuracy =
      summarise_accuracy(reports, target, plan.predicted_s,
                         "95 % bound on the cube's error: texel luminance, root mean square over "
                         "the sphere, relative to the job's mean luminance");
  assembly.accuracy.bias_bound = plan.bias_bound;
  assembly.document = std::move(document);
  return assembly;
}

}  // namespace lightkiln

#include <algorithm>
#include <cmath>
#include <string>

#include "core/bake/probes_state.h"
#include "core/bake/window_report.h"

namespace lightkiln {

void write_probe(const ProbeResult& result, ByteWriter& writer) {
  writer.u64(result.index);
  writer.u32(static_cast<uint32_t>(result.surroundings.status));
  writer.f64(result.surroundings.backface_share);
  writer.f64(result.surroundings.hit_share);
  writer.f64(result.surroundings.distance_mean);
  writer.f64(result.surroundings.distance_min);
  writer.u32(static_cast<uint32_t>(result.accuracy));
  writer.u64(result.samples);
  writer.f64(result.error);
  writer.f64(result.sh_error);
  for (const Vec3d& c : result.sh.coefficients) {
    writer.f64(c.x);
    writer.f64(c.y);
    writer.f64(c.z);
  }
  if (result.window.window != ShWindow::none) write_window_report(result.window, writer);
  writer.floats(result.radiance);
  writer.floats(result.distance);
}

namespace {

void fence(bool holds, const char* what) {
  if (!holds)
    throw Error(ErrorCode::internal, std::string("A chunk's bytes hold no probe's ") + what + ".");
}

bool is_share(double value) {
  return value >= 0 && value <= 1;
}
bool is_length(double value) {
  return value >= 0 && std::isfinite(value);
}

// Everything that bytes torn or shifted would break.
void check_probe(const ProbeResult& result) {
  const ProbeSurroundings& found = result.surroundings;
  fence(is_share(found.backface_share) && is_share(found.hit_share), "shares");
  fence(is_length(found.distance_mean) && is_length(found.distance_min), "distances");
  fence(result.samples > 0 && is_length(result.error) && is_length(result.sh_error), "errors");
  for (const Vec3d& c : result.sh.coefficients) fence(is_finite(c), "harmonics");
  for (const double factor : result.window.factors) fence(std::isfinite(factor), "window");
  const auto good = [](float value) { return value >= 0 && std::isfinite(value); };
  fence(std::all_of(result.radiance.begin(), result.radiance.end(), good), "radiance");
  fence(std::all_of(result.distance.begin(), result.distance.end(), good), "distance cube");
}

}  // namespace

ProbeResult read_probe(ByteReader& reader, const ProbesParameters& parameters, uint64_t index) {
  ProbeResult result;
  result.index = reader.u64();
  fence(result.index == index, "own index");
  const uint32_t status = reader.u32();
  fence(status <= static_cast<uint32_t>(ProbeStatus::on_surface), "status");
  result.surroundings.status = static_cast<ProbeStatus>(status);
  result.surroundings.backface_share = reader.f64();
  result.surroundings.hit_share = reader.f64();
  result.surroundings.distance_mean = reader.f64();
  result.surroundings.distance_min = reader.f64();
  const uint32_t accuracy = reader.u32();
  fence(accuracy <= static_cast<uint32_t>(AccuracyStatus::exact), "accuracy");
  result.accuracy = static_cast<AccuracyStatus>(accuracy);
  result.samples = reader.u64();
  result.error = reader.f64();
  result.sh_error = reader.f64();
  result.sh = ShRgb(parameters.sh.bands);
  for (Vec3d& c : result.sh.coefficients) {
    c.x = reader.f64();
    c.y = reader.f64();
    c.z = reader.f64();
  }
  const ProbeShOutput& sh = parameters.sh;
  if (sh.window != ShWindow::none)
    result.window = read_window_report(sh.window, sh.window_quantity, sh.bands, reader);
  const auto size = static_cast<size_t>(parameters.cubemap.size);
  result.radiance.resize(6 * size * size * 3);
  result.distance.resize(6 * size * size);
  reader.floats(result.radiance);
  reader.floats(result.distance);
  check_probe(result);
  return result;
}

}  // namespace lightkiln

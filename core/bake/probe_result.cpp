#include "core/bake/probes_state.h"

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
  writer.floats(result.radiance);
  writer.floats(result.distance);
}

ProbeResult read_probe(ByteReader& reader, const ProbesParameters& parameters) {
  ProbeResult result;
  result.index = reader.u64();
  result.surroundings.status = static_cast<ProbeStatus>(reader.u32());
  result.surroundings.backface_share = reader.f64();
  result.surroundings.hit_share = reader.f64();
  result.surroundings.distance_mean = reader.f64();
  result.surroundings.distance_min = reader.f64();
  result.accuracy = static_cast<AccuracyStatus>(reader.u32());
  result.samples = reader.u64();
  result.error = reader.f64();
  result.sh_error = reader.f64();
  result.sh = ShRgb(parameters.sh.bands);
  for (Vec3d& c : result.sh.coefficients) {
    c.x = reader.f64();
    c.y = reader.f64();
    c.z = reader.f64();
  }
  const auto size = static_cast<size_t>(parameters.cubemap.size);
  result.radiance.resize(6 * size * size * 3);
  result.distance.resize(6 * size * size);
  reader.floats(result.radiance);
  reader.floats(result.distance);
  return result;
}

}  // namespace lightkiln

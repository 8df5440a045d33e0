// The document of a result: what the images and tables beside it mean, in numbers and words that an
// importer can check itself against.

#include "proto/harmonics_json.h"
#include "proto/json.h"
#include "proto/json_writer.h"
#include "proto/layouts_json.h"

namespace lightkiln {
namespace {

void write_frame(JsonWriter& writer, const Spec& spec, const Plan& plan) {
  writer.member("kind", kind_name(plan.kind))
      .member("engine_version", plan.engine_version)
      .member("spec_digest", spec_digest(canonical_spec(spec)))
      .key("spec")
      .raw(canonical_spec(spec));
}

// World axes as glTF has them; every document says so.
void write_axes(JsonWriter& writer) {
  writer.member("handedness", "right")
      .member("up", "+Y")
      .member("forward", "+Z")
      .member("length_unit", "world units of the scene");
}

void write_radiance_convention(JsonWriter& writer, FaceOrientation faces) {
  writer.key("convention")
      .begin_object()
      .member("basis", "real spherical harmonics, orthonormal, polar axis +Z")
      .member("condon_shortley", false)
      .member("index", "l*l + l + m, m from -l to l")
      .member("channel_order", "rgb")
      .member("quantity", "radiance")
      .member("units", "linear radiance as in the input; nothing is divided by pi")
      .member("colour_space", "linear Rec. 709")
      .member("latlong", "image centre +Z, +X left of it at longitude +pi/2, top row +Y")
      .member("cube", faces == FaceOrientation::opengl
                          ? "six faces stacked top to bottom: +X -X +Y -Y +Z -Z of the world "
                            "(-x, y, z), as OpenGL looks them up"
                          : "six faces stacked top to bottom: +X -X +Y -Y +Z -Z");
  write_faces(writer, faces);
  writer.member("texel_convention", "half_texel");
  write_axes(writer);
  writer.end_object();
}

}  // namespace

void write_measured(JsonWriter& writer, const MeasuredError& measured) {
  writer.key("measured_error")
      .begin_object()
      .member("count", measured.count)
      .member("rms", measured.rms)
      .member("max", measured.max);
  if (measured.twin > 0) writer.member("twin_error", measured.twin);
  writer.end_object();
}

namespace {

// `measured` null: the coefficients have an error bar instead.
void write_sh(JsonWriter& writer, const ShDocument& document,
              const MeasuredError* measured = nullptr) {
  writer.begin_object().member("bands", document.sh.bands).key("coefficients").begin_array();
  for (const Vec3d& coefficient : document.sh.coefficients) writer.value(coefficient);
  writer.end_array().member("error", document.error);
  if (measured) write_measured(writer, *measured);
  writer.key("selftest").begin_array();
  for (const ShSelftest& test : document.selftest)
    writer.begin_object()
        .member("direction", test.direction)
        .member("radiance", test.radiance)
        .member("irradiance", test.irradiance)
        .end_object();
  writer.end_array().end_object();
}

void write_ao(JsonWriter& writer, const AoDocument& document) {
  writer.key("convention")
      .begin_object()
      .member("quantity", "openness: 1 = open sky, 0 = enclosed")
      .member("index", "pixel i of the strip, row by row from the top left, is vertex i")
      .member("units", "none")
      .member("colour_space", "linear, one channel");
  write_axes(writer);
  writer.end_object();
  writer.key("strip")
      .begin_object()
      .member("width", document.strip_width)
      .member("height", document.strip_height)
      .end_object();
  writer.key("statistics")
      .begin_object()
      .member("vertices", document.vertices)
      .member("mean", document.mean)
      .member("min", document.min)
      .member("max", document.max)
      .member("error_rms", document.error_rms)
      .member("error_max", document.error_max)
      .member("suspicious", document.suspicious)
      .member("budget_limited", document.budget_limited)
      .end_object();
  writer.key("meshes").begin_array();
  for (const AoMeshIndex& mesh : document.meshes)
    writer.begin_object()
        .member("name", mesh.name)
        .member("node", mesh.node)
        .member("mesh", mesh.mesh)
        .member("primitive", mesh.primitive)
        .member("first", mesh.first)
        .member("count", mesh.count)
        .member("mean", mesh.mean)
        .member("min", mesh.min)
        .member("max", mesh.max)
        .member("suspicious", mesh.suspicious)
        .member("budget_limited", mesh.budget_limited)
        .end_object();
  writer.end_array();
}

// `own` writes what only this product says.
void write_map(JsonWriter& writer, const MapDocument& map, const auto& own) {
  writer.begin_object().member("artifact", map.artifact).member("size", map.size);
  write_faces(writer, map.faces);
  own();
  writer.member("error_bound", map.error_bound);
  write_measured(writer, map.measured);
  writer.end_object();
}

void write_asset(JsonWriter& writer, const AssetDocument& document) {
  writer.begin_object()
      .member("artifact", document.artifact)
      .member("extension", "EXT_lights_image_based")
      .member("packing", "RGBD: (rgb / 255)^2.2 / (a / 255); at most 255");
  write_sh_window(writer, document.sh_window);
  writer.key("levels").begin_array();
  for (const AssetLevelDocument& level : document.levels) {
    writer.begin_object()
        .member("size", level.size)
        .member("roughness", level.roughness)
        .member("alpha", level.roughness * level.roughness)
        .member("error_bound", level.error_bound);
    write_measured(writer, level.measured);
    writer.key("packing_error")
        .begin_object()
        .member("rms", level.packing_rms)
        .member("max", level.packing_max)
        .member("cut_texels", level.cut_texels)
        .member("cut_share", level.cut_share)
        .end_object()
        .end_object();
  }
  writer.end_array().end_object();
}

void write_irradiance(JsonWriter& writer, const IrradianceDocument& irradiance) {
  writer.member("quantity", "irradiance")
      .member("method", irradiance.bands ? "harmonics" : "exact");
  if (!irradiance.bands) return;
  writer.member("bands", *irradiance.bands).key("omitted");
  writer.begin_object()
      .member("rms", irradiance.omitted_rms)
      .member("most", irradiance.omitted_most)
      .end_object();
}

void write_chain(JsonWriter& writer, const char* name, const std::vector<MapDocument>& levels) {
  writer.key(name).begin_array();
  for (const MapDocument& level : levels)
    write_map(writer, level, [&] {
      writer.member("level", level.level)
          .member("roughness", level.roughness)
          .member("alpha", level.roughness * level.roughness);
    });
  writer.end_array();
}

void write_coefficients(JsonWriter& writer, const ShRgb& sh) {
  writer.begin_object().member("bands", sh.bands).key("coefficients").begin_array();
  for (const Vec3d& coefficient : sh.coefficients) writer.value(coefficient);
  writer.end_array().end_object();
}

void write_sun(JsonWriter& writer, const EnvironmentDocument& document) {
  const SunExtraction& sun = *document.sun;
  writer.begin_object()
      .member("found", sun.found)
      .member("reason", sun.reason)
      .member("energy_before", sun.energy_before)
      .member("energy_after", sun.energy_after)
      .key("disk");
  if (!sun.found) {
    writer.null().end_object();
    return;
  }
  const double degrees = 180 / kPi;
  writer.begin_object()
      .member("artifact", document.sun_artifact)
      .member("direction", sun.disk.direction)
      .member("angular_radius_degrees", sun.disk.angular_radius_rad * degrees)
      .member("radiance", sun.disk.radiance)
      .member("energy", sun.disk.energy())
      .member("irradiance", sun.disk.irradiance())
      .member("contrast", sun.contrast)
      .member("texels", sun.texels)
      .member("extent_degrees", sun.extent_rad * degrees)
      .key("sh");
  write_coefficients(writer, document.sun_sh);
  write_measured(writer, document.sun_measured);
  writer.end_object().end_object();
}

void write_light_set_error(JsonWriter& writer, const LightSetError& error) {
  writer.begin_object()
      .member("lights", error.lights)
      .member("rms", error.rms)
      .member("max", error.max)
      .end_object();
}

void write_light_set(JsonWriter& writer, const LightSetDocument& set) {
  writer.begin_object()
      .member("artifact", set.artifact)
      .member("units",
              "irradiance of a facing surface: radiance of the input times steradians; lux in the "
              "glTF where a radiance of 1 is 1 cd/m^2, and then intensity times color")
      .member("energy", set.energy)
      .key("irradiance_error");
  write_light_set_error(writer, set.error);
  writer.key("irradiance_error_by_lights").begin_array();
  for (const LightSetError& row : set.by_lights) write_light_set_error(writer, row);
  writer.end_array().key("lights").begin_array();
  for (const DirectionalLight& light : set.lights)
    writer.begin_object()
        .member("direction", light.direction)
        .member("irradiance", light.irradiance)
        .end_object();
  writer.end_array().end_object();
}

void write_environment(JsonWriter& writer, const EnvironmentDocument& document) {
  write_radiance_convention(writer, document.faces);
  writer.key("source")
      .begin_object()
      .member("width", document.source_width)
      .member("height", document.source_height)
      .member("format", document.source_format);
  write_source_layout(writer, document);
  writer.member("mean", document.mean)
      .member("max_luminance", document.max_luminance)
      .key("repairs")
      .begin_object()
      .member("nan", document.repairs.nan)
      .member("infinite", document.repairs.infinite)
      .member("negative", document.repairs.negative)
      .end_object()
      .end_object();
  writer.key("sh");
  if (document.sh)
    write_sh(writer, *document.sh, &document.sh_measured);
  else
    writer.null();
  write_harmonics(writer, document);
  writer.key("irradiance");
  if (document.irradiance)
    write_map(writer, *document.irradiance,
              [&] { write_irradiance(writer, *document.irradiance); });
  else
    writer.null();
  write_chain(writer, "prefilter", document.prefilter);
  write_chain(writer, "sheen", document.sheen);
  writer.key("dfg");
  if (document.dfg)
    write_map(writer, *document.dfg, [&] {
      writer.member("multiple_scattering", document.dfg->multiple_scattering)
          .member("charlie", document.dfg->charlie);
    });
  else
    writer.null();
  writer.key("asset");
  if (document.asset)
    write_asset(writer, *document.asset);
  else
    writer.null();
  writer.key("layouts");
  write_layouts(writer, document.layouts);
  writer.key("sun");
  if (document.sun)
    write_sun(writer, document);
  else
    writer.null();
  writer.key("light_set");
  if (document.light_set)
    write_light_set(writer, *document.light_set);
  else
    writer.null();
}

void write_probes(JsonWriter& writer, const ProbesDocument& document) {
  write_radiance_convention(writer, document.faces);
  writer.member("cubemap_size", document.cubemap_size).key("probes").begin_array();
  for (const ProbeDocument& probe : document.probes) {
    writer.begin_object()
        .member("index", probe.index)
        .member("position", probe.position)
        .member("status", probe_status_name(probe.status))
        .member("backface_share", probe.backface_share)
        .member("hit_share", probe.hit_share)
        .member("distance_mean", probe.distance_mean)
        .member("distance_min", probe.distance_min)
        .member("error", probe.error)
        .member("accuracy", accuracy_status_name(probe.accuracy))
        .member("radiance", probe.radiance_artifact)
        .member("distance", probe.distance_artifact)
        .key("sh");
    write_sh(writer, probe.sh);
    write_sh_window(writer, probe.sh_window);
    writer.end_object();
  }
  writer.end_array();
}

}  // namespace

std::string write_document(const Assembly& assembly, const Spec& spec, const Plan& plan) {
  JsonWriter writer;
  writer.begin_object();
  write_frame(writer, spec, plan);
  if (const auto* ao = std::get_if<AoDocument>(&assembly.document))
    write_ao(writer, *ao);
  else if (const auto* environment = std::get_if<EnvironmentDocument>(&assembly.document))
    write_environment(writer, *environment);
  else
    write_probes(writer, std::get<ProbesDocument>(assembly.document));
  writer.key("artifacts").begin_array();
  for (const Artifact& artifact : assembly.artifacts)
    writer.begin_object()
        .member("name", artifact.name)
        .member("role", artifact.role)
        .member("media_type", artifact.media_type)
        .member("bytes", artifact.bytes.size())
        .member("digest", sha256_digest(artifact.bytes.data(), artifact.bytes.size()))
        .end_object();
  writer.end_array().end_object();
  return writer.take();
}

std::string document_name(Kind kind) {
  return std::string(kind_name(kind)) + ".json";
}

}  // namespace lightkiln

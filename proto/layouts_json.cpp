#include "proto/layouts_json.h"

#include "proto/harmonics_json.h"

namespace lightkiln {
namespace {

const char* convention_name(const MapLayout& layout) {
  return layout.convention == TexelConvention::openexr ? "openexr" : "half_texel";
}

// What the layout's name leaves open.
void write_form(JsonWriter& writer, const MapLayout& layout) {
  writer.member("texel_convention", convention_name(layout));
  if (layout.kind == LayoutKind::mirror_ball) {
    writer.key("distance");
    if (layout.camera_distance > 0)
      writer.value(layout.camera_distance);
    else
      writer.null();
  }
  if (layout.kind == LayoutKind::mirror_ball || layout.kind == LayoutKind::angular)
    writer.member("mirrored", layout.mirrored);
}

void write_round_trip(JsonWriter& writer, const RoundTrip& trip) {
  writer.begin_object().member("relative_rms", trip.relative_rms).key("psnr_db");
  if (trip.psnr_db)
    writer.value(*trip.psnr_db);
  else
    writer.null();
  writer.member("not_covered_share", trip.not_covered_share)
      .member("mean_luminance_before", trip.mean_before)
      .member("mean_luminance_after", trip.mean_after)
      .end_object();
}

}  // namespace

void write_source_layout(JsonWriter& writer, const EnvironmentDocument& document) {
  writer.member("layout", layout_name(document.source_layout.kind));
  write_form(writer, document.source_layout);
  writer.member("covered_share", document.source_covered_share)
      .member("conversion_error", document.source_conversion_error)
      .key("rotation")
      .begin_array();
  for (const auto& row : document.rotation.rows) {
    writer.begin_array();
    for (const double value : row) writer.value(value);
    writer.end_array();
  }
  writer.end_array();
}

void write_faces(JsonWriter& writer, FaceOrientation faces) {
  if (faces != FaceOrientation::openexr)
    writer.member("face_orientation", face_orientation_name(faces));
}

void write_layouts(JsonWriter& writer, const std::vector<LayoutDocument>& layouts) {
  writer.begin_array();
  for (const LayoutDocument& entry : layouts) {
    const bool faces = entry.artifacts.size() > 1;
    writer.begin_object().member("layout", entry.name).key("artifacts").begin_array();
    for (const std::string& artifact : entry.artifacts) writer.value(artifact);
    writer.end_array()
        .member("width", entry.layout.width)
        .member("height", faces ? entry.layout.width : entry.layout.height);
    write_form(writer, entry.layout);
    write_faces(writer, entry.faces);
    writer.member("covered_share", covered_solid_angle(entry.layout) / (4 * kPi))
        .member("error_bound", entry.error_bound);
    write_measured(writer, entry.measured);
    writer.key("round_trip");
    if (entry.round_trip)
      write_round_trip(writer, *entry.round_trip);
    else
      writer.null();
    writer.end_object();
  }
  writer.end_array();
}

}  // namespace lightkiln

#pragma once

// What a result says of layouts.

#include <vector>

#include "core/bake/bake.h"
#include "proto/json_writer.h"

namespace lightkiln {

// Members of the source's object: how its file was read, and how it was turned.
void write_source_layout(JsonWriter& writer, const EnvironmentDocument& document);
// The member face_orientation, of cubes in another one than OpenEXR's alone.
void write_faces(JsonWriter& writer, FaceOrientation faces);
void write_layouts(JsonWriter& writer, const std::vector<LayoutDocument>& layouts);

}  // namespace lightkiln

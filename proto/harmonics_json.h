#pragma once

// Parts of a result's document that are made of coefficients.

#include "core/bake/bake.h"
#include "proto/json_writer.h"

namespace lightkiln {

// The members sh_window, zh3, sh_exports and spectrum; null or empty where nothing was ordered.
void write_harmonics(JsonWriter& writer, const EnvironmentDocument& document);

// The member sh_window: what a window did; null where there is none.
void write_sh_window(JsonWriter& writer, const std::optional<ShWindowReport>& report);

// The member that says what an output differs by from its twin (document_json.cpp).
void write_measured(JsonWriter& writer, const MeasuredError& measured);

}  // namespace lightkiln

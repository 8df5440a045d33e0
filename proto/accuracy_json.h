#pragma once

// Rounds and prices inside other documents.

#include "core/bake/accuracy.h"
#include "proto/json_writer.h"

namespace lightkiln {

// With rms errors over `elements`.
void write_rounds(JsonWriter& writer, const std::vector<Round>& rounds, uint64_t elements);
void write_prices(JsonWriter& writer, const std::vector<Price>& prices);

}  // namespace lightkiln

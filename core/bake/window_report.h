#pragma once

// What a window did, in chunk bytes, and what it takes.

#include "core/bake/kitchen.h"
#include "core/sphere/harmonic_window.h"

namespace lightkiln {

// Of a window other than none: its numbers, not the names that were ordered.
void write_window_report(const ShWindowReport& report, ByteWriter& writer);
ShWindowReport read_window_report(ShWindow window, ShQuantity quantity, int bands,
                                  ByteReader& reader);

// CPU seconds on the model's core (maps_cost.h) of windowing `bands` bands once.
double window_seconds(ShWindow window, int bands);

}  // namespace lightkiln

#pragma once

// What a spec is baked from: one file, a .gltf with the files that it names, or the six faces of a
// cube.

#include "proto/faults.h"
#include "proto/spec_table.h"

namespace lightkiln {

// Reads the member "inputs" of a spec by the rows of its kind; every fault goes to root.faults.
void read_inputs(const JsonPlace& root, const KindTable& table, Spec* spec);

}  // namespace lightkiln

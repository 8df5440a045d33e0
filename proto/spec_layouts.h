#pragma once

// Rows of parameters.source, parameters.rotation, parameters.cubes and parameters.layouts.

#include <vector>

#include "proto/spec_table.h"

namespace lightkiln {

// Of environment_maps and of probes, whose environment is read in the same way.
ParameterGroup maps_source_group();
ParameterGroup probes_source_group();
ParameterGroup maps_rotation_group();
ParameterGroup probes_rotation_group();
// How cubes are written.
ParameterGroup maps_cubes_group();
ParameterGroup probes_cubes_group();
// The object of all layouts, then each of them.
std::vector<ParameterGroup> layout_groups();

}  // namespace lightkiln

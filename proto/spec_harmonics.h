#pragma once

// Rows of parameters.sh, and of what else is windowed.

#include "proto/spec_table.h"

namespace lightkiln {

ParameterGroup maps_sh_group();
ParameterGroup probes_sh_group();
// Of the coefficients in a glTF asset.
ParameterRow asset_window_row();

}  // namespace lightkiln

#pragma once

// Specs as a part of other documents: what parse_spec() does, below a place of its own.

#include "proto/faults.h"

namespace lightkiln {

// Reads a spec at `root`, telling every fault there is. The result can be baked when none was told.
Spec read_spec(const JsonPlace& root);

// "a whole number from 64 to 1048576, or null": for faults and for GET /v1/kinds.
struct ParameterRow;
std::string allowed_values(const ParameterRow& row);

}  // namespace lightkiln

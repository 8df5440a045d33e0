#pragma once

// Numbers in sentences for people.

#include <string>

namespace lightkiln {

// `digits` significant digits, trailing zeros left out: 0.125, 1.5e-07, 12.
std::string short_number(double value, int digits = 3);

}  // namespace lightkiln

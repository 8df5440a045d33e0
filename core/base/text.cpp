#include "core/base/text.h"

#include <cstdio>

namespace lightkiln {

std::string short_number(double value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

}  // namespace lightkiln

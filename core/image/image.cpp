#include "core/image/image.h"

#include <string>

#include "core/base/error.h"

namespace lightkiln {

void check_image_size(int64_t width, int64_t height, const std::string& what) {
  const std::string size = std::to_string(width) + " x " + std::to_string(height);
  if (width < 1 || height < 1)
    throw Error(ErrorCode::invalid_input, what + " of " + size + " pixels has nothing in it.");
  if (width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels) {
    throw Error(ErrorCode::too_large, what + " of " + size + " pixels is too large: at most " +
                                          std::to_string(kMaxImageSide) + " a side and " +
                                          std::to_string(kMaxImagePixels) +
                                          " altogether are allowed.");
  }
}

std::string printable(std::string text) {
  constexpr size_t kLongest = 200;
  if (text.size() > kLongest) text.replace(kLongest, std::string::npos, "...");
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return text;
}

}  // namespace lightkiln

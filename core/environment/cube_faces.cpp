#include "core/environment/cube_faces.h"

#include <algorithm>
#include <cassert>
#include <string>
#include <utility>

#include "core/base/error.h"

namespace lightkiln {

namespace {

std::string size_of(const Image& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height);
}

}  // namespace

void CubeOfFaces::add(DecodedImage face) {
  assert(count_ < kCubeFaceNames.size());
  const std::string name = std::string("The face ") + kCubeFaceNames[count_];
  const Image& image = face.image;
  const int size = count_ == 0 ? image.width : cube_.image.width;
  if (image.width != image.height || image.width != size) {
    throw Error(
        ErrorCode::invalid_input,
        name + " is " + size_of(image) + " pixels" +
            (count_ == 0 ? "" : " and px " + std::to_string(size) + " x " + std::to_string(size)) +
            "; the six faces of a cube are squares of one size.");
  }
  if (size > kMaxCubeFace) {
    throw Error(ErrorCode::too_large, name + " is " + size_of(image) +
                                          " pixels; a cube of six files has faces of at most " +
                                          std::to_string(kMaxCubeFace) + " texels a side.");
  }
  if (count_ == 0) {
    cube_.image = Image(size, 6 * size, 3);
    cube_.format = "six files, " + face.format;
    cube_.display_referred = true;
  }
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const Vec3 value = image.rgb(x, y);
      std::copy_n(&value.x, 3, cube_.image.at(x, static_cast<int>(count_) * size + y));
    }
  }
  if (cube_.format != "six files, " + face.format) cube_.format = "six files of several formats";
  cube_.display_referred &= face.display_referred;
  cube_.pixels_missing += face.pixels_missing;
  cube_.pixels_outside += face.pixels_outside;
  ++count_;
}

DecodedImage CubeOfFaces::take() {
  assert(count_ == kCubeFaceNames.size());
  return std::move(cube_);
}

}  // namespace lightkiln

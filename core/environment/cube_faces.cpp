#include "core/environment/cube_faces.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"

namespace lightkiln {

namespace {

std::string size_of(const Image& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height);
}

void require_equal_squares(const std::array<DecodedImage, 6>& faces) {
  const Image& first = faces[0].image;
  for (size_t i = 0; i < faces.size(); ++i) {
    const Image& face = faces[i].image;
    if (face.width == face.height && face.width == first.width) continue;
    throw Error(ErrorCode::invalid_input, std::string("The face ") + kCubeFaceNames[i] + " is " +
                                              size_of(face) + " pixels and px " + size_of(first) +
                                              "; the six faces of a cube are squares of one size.");
  }
}

}  // namespace

DecodedImage join_faces(std::array<DecodedImage, 6> faces) {
  require_equal_squares(faces);
  const int size = faces[0].image.width;
  check_image_size(size, int64_t{6} * size, "A cube of six files");
  DecodedImage cube;
  cube.image = Image(size, 6 * size, 3);
  cube.format = faces[0].format;
  for (size_t i = 0; i < faces.size(); ++i) {
    const DecodedImage& face = faces[i];
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const Vec3 value = face.image.rgb(x, y);
        std::copy_n(&value.x, 3, cube.image.at(x, static_cast<int>(i) * size + y));
      }
    }
    if (face.format != faces[0].format) cube.format = "files of several formats";
    cube.display_referred |= face.display_referred;
    cube.pixels_missing += face.pixels_missing;
    cube.pixels_outside += face.pixels_outside;
  }
  if (cube.format == faces[0].format) cube.format = "six files, " + cube.format;
  return cube;
}

}  // namespace lightkiln

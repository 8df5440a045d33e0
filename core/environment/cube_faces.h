#pragma once

// A cube that comes as six files.

#include <array>

#include "core/environment/lookup_cube.h"
#include "core/image/image.h"

namespace lightkiln {

// Of the faces +X -X +Y -Y +Z -Z in specs, file names and messages.
inline constexpr std::array<const char*, 6> kCubeFaceNames = {"px", "nx", "py", "ny", "pz", "nz"};
inline constexpr int kMaxCubeFace = kMaxImageSide / 6;  // texels along a side

// Joins six images to one strip N x 6N with three channels, one after another, so that no more than
// one stands beside the strip.
class CubeOfFaces {
 public:
  // The next face in the order of kCubeFaceNames, framed (see frame_as_displayed); the layout that
  // its file claims is dropped. Throws Error by the face's name: invalid_input unless it is a
  // square of the first one's size, too_large above kMaxCubeFace.
  void add(DecodedImage face);

  // The strip, once six were added. It is display-referred when all of them are.
  DecodedImage take();

 private:
  DecodedImage cube_;
  size_t count_ = 0;
};

}  // namespace lightkiln

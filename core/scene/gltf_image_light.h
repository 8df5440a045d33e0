#pragma once

// A prefiltered environment as a glTF asset of its own (EXT_lights_image_based).

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

struct GltfImageLight {
  std::string name;
  int size = 0;  // texels along a face's side of level 0
  // Irradiance in the basis and the axes that the extension's viewers read, rows of R, G, B.
  std::array<Vec3d, 9> irradiance_coefficients;
  // [level][face]: RGBD PNG files; faces +X -X +Y -Y +Z -Z as those viewers look them up, each
  // level half the size of the one before.
  std::vector<std::array<std::vector<std::byte>, 6>> specular_images;
};

// A GLB whose one scene is lit by `light` and holds nothing else. Intensity is written as 1 and no
// rotation is: the extension's schema bounds a quaternion's components to 0..1, so that a file with
// most rotations fails strict validators, and Babylon.js 9 multiplies diffuse light by intensity
// twice. `generator` goes into asset.generator.
std::vector<std::byte> write_gltf_image_light(const GltfImageLight& light,
                                              const std::string& generator);

}  // namespace lightkiln

#pragma once

// Directional lights as a glTF of their own (KHR_lights_punctual).

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/base/math.h"

namespace lightkiln {

struct GltfDirectionalLight {
  std::string name;
  Vec3d direction;   // unit, towards the light; its node's -Z looks the other way, as light travels
  Vec3d irradiance;  // on a facing surface, >= 0 and not all 0. In lux when radiance is in cd/m^2
};

// A .gltf (JSON) with one node a light. The extension's intensity is illuminance in lux on a facing
// surface: `color` is the irradiance over its largest channel, `intensity` that channel, so that
// their product is the irradiance. `generator` goes into asset.generator.
std::vector<std::byte> write_gltf_lights(std::span<const GltfDirectionalLight> lights,
                                         const std::string& generator);

}  // namespace lightkiln

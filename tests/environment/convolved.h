#pragma once

// Maps and levels for tests of convolution.

#include "core/environment/lobe_averages.h"
#include "core/environment/prefilter.h"
#include "core/image/decode.h"

namespace lightkiln::test {

inline Environment environment_of(const Image& image) {
  DecodedImage decoded;
  decoded.image = image;
  return make_environment(decoded);
}

struct Level {
  LobePlan plan;
  Image cube;
  RangeReport range;
};
inline Level convolve(const Environment& environment, const LobePlan& plan, int size) {
  Progress progress;
  Level level{plan, {}, {}};
  const LatlongSpectrum spectrum = project_for(environment, {&level.plan, 1}, 1, 2, progress);
  level.cube = convolve_lobe(environment, measure_light(environment), spectrum, level.plan, size, 2,
                             progress, &level.range);
  return level;
}
inline Level convolve(const Environment& environment, const Lobe& lobe, int size, double target) {
  return convolve(environment, plan_lobe(measure_light(environment), lobe, target), size);
}

// The slow twin at one direction.
inline Vec3d slow_average(const Environment& environment, const Lobe& lobe, const Vec3d& axis) {
  Progress progress;
  return lobe_averages(environment, *make_twin_lobe(lobe), {&axis, 1}, 1, progress).means[0];
}

// Every texel of a map cut into factor x factor equal ones.
inline Image enlarged(const Image& map, int factor) {
  Image result(map.width * factor, map.height * factor, 3);
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      std::copy_n(map.at(x / factor, y / factor), 3, result.at(x, y));
    }
  }
  return result;
}

}  // namespace lightkiln::test

#include "core/scene/scene.h"

#include <algorithm>

namespace lightkiln {

// frexp gives extent = m * 2^e with 0.5 <= m < 1, so 2^-e brings the extent into [0.5, 1).
Normalisation make_normalisation(const Bounds& world) {
  if (world.empty()) return {};
  Normalisation result;
  // Halves are added, not the sum halved: no overflow at either end of the range.
  result.centre = world.lower * 0.5 + world.upper * 0.5;
  const Vec3d extent = world.extent();
  const double largest = std::max(extent.x, std::max(extent.y, extent.z));
  int exponent = 0;
  if (largest > 0) std::frexp(largest, &exponent);
  result.exponent = -exponent;
  return result;
}

void grow(Bounds& bounds, const Vec3d& point) {
  for (int axis = 0; axis < 3; ++axis) {
    bounds.lower[axis] = std::min(bounds.lower[axis], point[axis]);
    bounds.upper[axis] = std::max(bounds.upper[axis], point[axis]);
  }
}

}  // namespace lightkiln

// Six directions that no mirror, axis swap or sign of a basis function leaves all alone: the three
// positive axes and three oblique ones of unequal components.

#include "core/bake/documents.h"

namespace lightkiln {

std::vector<ShSelftest> make_selftest(const ShRgb& sh) {
  constexpr Vec3d kDirections[] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},
                                   {-1, 2, 3}, {3, -1, 2}, {-2, -3, -1}};
  std::vector<ShSelftest> tests;
  for (const Vec3d& direction : kDirections) {
    const Vec3d unit = normalize(direction);
    tests.push_back({unit, sh_evaluate(sh, unit), sh_irradiance(sh, unit)});
  }
  return tests;
}

}  // namespace lightkiln

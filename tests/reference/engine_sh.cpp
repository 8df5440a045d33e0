#include "tests/reference/engine_sh.h"

#include <cmath>

namespace lightkiln::reference {

Vec3d three_radiance(Nine c, const Vec3d& n) {
  return c[0] * 0.282095 + c[1] * (0.488603 * n.y) + c[2] * (0.488603 * n.z) +
         c[3] * (0.488603 * n.x) + c[4] * (1.092548 * n.x * n.y) + c[5] * (1.092548 * n.y * n.z) +
         c[6] * (0.315392 * (3 * n.z * n.z - 1)) + c[7] * (1.092548 * n.x * n.z) +
         c[8] * (0.546274 * (n.x * n.x - n.y * n.y));
}

Vec3d three_irradiance(Nine c, const Vec3d& n) {
  return c[0] * 0.886227 + c[1] * (2 * 0.511664 * n.y) + c[2] * (2 * 0.511664 * n.z) +
         c[3] * (2 * 0.511664 * n.x) + c[4] * (2 * 0.429043 * n.x * n.y) +
         c[5] * (2 * 0.429043 * n.y * n.z) + c[6] * (0.743125 * n.z * n.z - 0.247708) +
         c[7] * (2 * 0.429043 * n.x * n.z) + c[8] * (0.429043 * (n.x * n.x - n.y * n.y));
}

Vec3d filament_diffuse(Nine c, const Vec3d& n) {
  return c[0] + c[1] * n.y + c[2] * n.z + c[3] * n.x + c[4] * (n.y * n.x) + c[5] * (n.y * n.z) +
         c[6] * (3 * n.z * n.z - 1) + c[7] * (n.z * n.x) + c[8] * (n.x * n.x - n.y * n.y);
}

Vec3d unity_diffuse(std::span<const double> flat, const Vec3d& n) {
  Vec3d result;
  for (int channel = 0; channel < 3; ++channel) {
    const double* sh = &flat[static_cast<size_t>(9 * channel)];
    const double sha[4] = {sh[3], sh[1], sh[2], sh[0] - sh[6]};
    const double shb[4] = {sh[4], sh[5], sh[6] * 3, sh[7]};
    const double shc = sh[8];
    result[channel] = sha[0] * n.x + sha[1] * n.y + sha[2] * n.z + sha[3] + shb[0] * n.x * n.y +
                      shb[1] * n.y * n.z + shb[2] * n.z * n.z + shb[3] * n.z * n.x +
                      shc * (n.x * n.x - n.y * n.y);
  }
  return result;
}

std::vector<std::array<double, 4>> unreal_pack(Nine c) {
  const double root = std::sqrt(kPi);
  const double c0 = 1 / (2 * root), c1 = std::sqrt(3.0) / (3 * root);
  const double c2 = std::sqrt(15.0) / (8 * root), c3 = std::sqrt(5.0) / (16 * root), c4 = 0.5 * c2;
  std::vector<std::array<double, 4>> packed;
  for (int k = 0; k < 3; ++k) {
    packed.push_back({-c1 * c[3][k], -c1 * c[1][k], c1 * c[2][k], c0 * c[0][k] - c3 * c[6][k]});
  }
  for (int k = 0; k < 3; ++k) {
    packed.push_back({c2 * c[4][k], -c2 * c[5][k], 3 * c3 * c[6][k], -c2 * c[7][k]});
  }
  packed.push_back({c4 * c[8].x, c4 * c[8].y, c4 * c[8].z, 1});
  return packed;
}

Vec3d unreal_diffuse(std::span<const std::array<double, 4>> packed, const Vec3d& n) {
  Vec3d result;
  for (int k = 0; k < 3; ++k) {
    const auto& a = packed[static_cast<size_t>(k)];
    const auto& b = packed[static_cast<size_t>(3 + k)];
    result[k] = a[0] * n.x + a[1] * n.y + a[2] * n.z + a[3] + b[0] * n.x * n.y + b[1] * n.y * n.z +
                b[2] * n.z * n.z + b[3] * n.z * n.x +
                packed[6][static_cast<size_t>(k)] * (n.x * n.x - n.y * n.y);
  }
  return result;
}

Vec3d babylon_diffuse(Nine harmonics, const Vec3d& n) {
  const double one = std::sqrt(3 / (4 * kPi)), two = std::sqrt(15 / (4 * kPi));
  const double constants[9] = {
      std::sqrt(1 / (4 * kPi)),  -one, one, -one, two, -two, std::sqrt(5 / (16 * kPi)), -two,
      std::sqrt(15 / (16 * kPi))};
  const double terms[9] = {
      1, n.y, n.z, n.x, n.y * n.x, n.y * n.z, 3 * n.z * n.z - 1, n.z * n.x, n.x * n.x - n.y * n.y};
  Vec3d sum;
  for (size_t i = 0; i < 9; ++i) sum += harmonics[i] * (constants[i] * terms[i]);
  return sum;
}

std::vector<Vec3d> babylon_from_polynomial(Nine p) {
  const Vec3d &x = p[0], &y = p[1], &z = p[2], &xx = p[3], &yy = p[4], &zz = p[5];
  const Vec3d &yz = p[6], &zx = p[7], &xy = p[8];
  std::vector<Vec3d> h = {xx * 0.376127 + yy * 0.376127 + zz * 0.376126,
                          y * -0.977204,
                          z * 0.977204,
                          x * -0.977204,
                          xy * 1.16538,
                          yz * -1.16538,
                          zz * 1.34567 - xx * 0.672834 - yy * 0.672834,
                          zx * -1.16538,
                          xx * 1.16538 - yy * 1.16538};
  for (Vec3d& value : h) value *= kPi;
  return h;
}

Vec3d ext_lights_image_based_diffuse(Nine coefficients, const Vec3d& n) {
  return babylon_diffuse(coefficients, n) / kPi;
}

Vec3d godot_diffuse(Nine c, const Vec3d& n) {
  return c[0] * 0.886227 + c[1] * (1.023327 * n.y) + c[2] * (1.023327 * n.z) +
         c[3] * (1.023327 * n.x) + c[4] * (0.858086 * n.x * n.y) + c[5] * (0.858086 * n.y * n.z) +
         c[6] * (0.247708 * (3 * n.z * n.z - 1)) + c[7] * (0.858086 * n.x * n.z) +
         c[8] * (0.429043 * (n.x * n.x - n.y * n.y));
}

}  // namespace lightkiln::reference

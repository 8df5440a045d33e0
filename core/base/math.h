#pragma once

// Small vectors and the few geometric helpers that every floor above uses.

#include <cmath>
#include <cstdint>
#include <numbers>

namespace lightkiln {

inline constexpr double kPi = std::numbers::pi;

template <typename T>
struct Vector3 {
  T x{}, y{}, z{};

  constexpr T operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  constexpr T& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
  constexpr Vector3 operator-() const { return {-x, -y, -z}; }
  constexpr Vector3& operator+=(const Vector3& b) { return *this = *this + b; }
  constexpr Vector3& operator-=(const Vector3& b) { return *this = *this - b; }
  constexpr Vector3& operator*=(T s) { return *this = *this * s; }

  friend constexpr Vector3 operator+(const Vector3& a, const Vector3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend constexpr Vector3 operator-(const Vector3& a, const Vector3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  // Component by component, as for colours.
  friend constexpr Vector3 operator*(const Vector3& a, const Vector3& b) {
    return {a.x * b.x, a.y * b.y, a.z * b.z};
  }
  friend constexpr Vector3 operator*(const Vector3& a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr Vector3 operator*(T s, const Vector3& a) { return a * s; }
  friend constexpr Vector3 operator/(const Vector3& a, T s) { return {a.x / s, a.y / s, a.z / s}; }
  friend constexpr bool operator==(const Vector3& a, const Vector3& b) = default;
};

using Vec3 = Vector3<float>;
using Vec3d = Vector3<double>;

struct Vec2 {
  float x{}, y{};
  friend constexpr bool operator==(const Vec2& a, const Vec2& b) = default;
};

template <typename T>
constexpr T dot(const Vector3<T>& a, const Vector3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
constexpr Vector3<T> cross(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <typename T>
T length(const Vector3<T>& a) {
  return std::sqrt(dot(a, a));
}
// The caller guarantees a length above zero.
template <typename T>
Vector3<T> normalize(const Vector3<T>& a) {
  return a / length(a);
}
template <typename T>
bool is_finite(const Vector3<T>& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
constexpr Vec3d to_double(const Vec3& a) {
  return {a.x, a.y, a.z};
}
constexpr Vec3 to_float(const Vec3d& a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}

// Relative luminance of linear Rec. 709 radiance (ITU-R BT.709).
template <typename T>
constexpr T luminance(const Vector3<T>& rgb) {
  return T(0.2126) * rgb.x + T(0.7152) * rgb.y + T(0.0722) * rgb.z;
}

// Two unit vectors that complete the unit vector n to a right-handed orthonormal basis
// (tangent, bitangent, n).
template <typename T>
struct Basis {
  Vector3<T> tangent, bitangent, normal;

  Vector3<T> to_world(const Vector3<T>& local) const {
    return tangent * local.x + bitangent * local.y + normal * local.z;
  }
};

// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. The sign of n.z is
// copied so that neither pole cancels: the error stays at 5e-8 in float everywhere, where the
// earlier formula errs by 0.16 near n = -z.
template <typename T>
Basis<T> make_basis(const Vector3<T>& n) {
  const T sign = std::copysign(T(1), n.z);
  const T a = T(-1) / (sign + n.z);
  const T b = n.x * n.y * a;
  return {{T(1) + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

// A 3x4 affine map, row-major: p' = linear * p + translation.
struct Affine {
  double linear[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Vec3d translation;

  Vec3d vector(const Vec3d& v) const {
    return {linear[0][0] * v.x + linear[0][1] * v.y + linear[0][2] * v.z,
            linear[1][0] * v.x + linear[1][1] * v.y + linear[1][2] * v.z,
            linear[2][0] * v.x + linear[2][1] * v.y + linear[2][2] * v.z};
  }
  Vec3d point(const Vec3d& p) const { return vector(p) + translation; }
};

}  // namespace lightkiln

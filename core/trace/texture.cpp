#include "core/trace/texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/pinned_math.h"
#include "core/image/ldr.h"

namespace lightkiln {

// glTF's wrap modes.
int64_t wrap_index(int64_t index, int64_t size, WrapMode mode) {
  switch (mode) {
    case WrapMode::clamp:
      return std::clamp<int64_t>(index, 0, size - 1);
    case WrapMode::repeat:
      return ((index % size) + size) % size;
    case WrapMode::mirrored_repeat: {
      const int64_t period = ((index % (2 * size)) + 2 * size) % (2 * size);
      return period < size ? period : 2 * size - 1 - period;
    }
  }
  return 0;
}

namespace {

// Beyond 2^40 texels a float coordinate has no fraction left; the bound keeps the integer
// conversion defined.
double texel_coordinate(float coordinate, int size) {
  if (!std::isfinite(coordinate)) return 0;
  return std::clamp(static_cast<double>(coordinate) * size, -0x1p40, 0x1p40);
}

// The texels that a look-up reads and their weights: one for nearest, four for bilinear.
struct Footprint {
  std::array<size_t, 4> texel;  // offsets into rgba
  std::array<float, 4> weight;
  int count = 0;
};

Footprint footprint(const Texture& texture, const Vec2& uv) {
  const double x = texel_coordinate(uv.x, texture.width);
  const double y = texel_coordinate(uv.y, texture.height);
  const auto offset = [&](int64_t column, int64_t row) {
    column = wrap_index(column, texture.width, texture.wrap_s);
    row = wrap_index(row, texture.height, texture.wrap_t);
    return static_cast<size_t>(row * texture.width + column) * 4;
  };
  Footprint print;
  if (texture.nearest) {
    print.count = 1;
    print.texel[0] =
        offset(static_cast<int64_t>(std::floor(x)), static_cast<int64_t>(std::floor(y)));
    print.weight[0] = 1;
    return print;
  }
  // Texel centres lie at half integers.
  const double left = std::floor(x - 0.5);
  const double top = std::floor(y - 0.5);
  const float fx = static_cast<float>(x - 0.5 - left);
  const float fy = static_cast<float>(y - 0.5 - top);
  const auto column = static_cast<int64_t>(left);
  const auto row = static_cast<int64_t>(top);
  print.count = 4;
  print.texel = {offset(column, row), offset(column + 1, row), offset(column, row + 1),
                 offset(column + 1, row + 1)};
  print.weight = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
  return print;
}

const std::array<float, 256>& srgb_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i)
      values[static_cast<size_t>(i)] = srgb_to_linear(static_cast<uint8_t>(i));
    return values;
  }();
  return table;
}

}  // namespace

Vec2 transform_texcoord(const TextureSlot& slot, const Vec2& uv) {
  const float u = slot.scale.x * uv.x;
  const float v = slot.scale.y * uv.y;
  if (slot.rotation_rad == 0) return {slot.offset.x + u, slot.offset.y + v};
  const SinCos turned = pinned_sin_cos(static_cast<double>(slot.rotation_rad));
  const auto c = static_cast<float>(turned.cos), s = static_cast<float>(turned.sin);
  return {slot.offset.x + c * u + s * v, slot.offset.y - s * u + c * v};
}

Vec4 sample_texture(const Texture& texture, const Vec2& uv) {
  const Footprint print = footprint(texture, uv);
  const auto& linear = srgb_table();
  Vec4 sum;
  for (size_t i = 0; i < static_cast<size_t>(print.count); ++i) {
    const uint8_t* texel = texture.rgba.data() + print.texel[i];
    const float weight = print.weight[i];
    sum.x += weight * linear[texel[0]];
    sum.y += weight * linear[texel[1]];
    sum.z += weight * linear[texel[2]];
    sum.w += weight * static_cast<float>(texel[3]);
  }
  sum.w /= 255.0f;
  return sum;
}

float sample_texture_alpha(const Texture& texture, const Vec2& uv) {
  const Footprint print = footprint(texture, uv);
  float sum = 0;
  for (size_t i = 0; i < static_cast<size_t>(print.count); ++i)
    sum += print.weight[i] * static_cast<float>(texture.rgba[print.texel[i] + 3]);
  return sum / 255.0f;
}

Vec2 interpolate_texcoord(const SurfaceMesh& mesh, int texcoord, uint32_t triangle, float u,
                          float v) {
  const std::vector<Vec2>& set = mesh.texcoords[texcoord == 1 ? 1 : 0];
  if (set.empty()) return {};
  const auto& corner = mesh.triangles[triangle];
  const Vec2& a = set[corner[0]];
  const Vec2& b = set[corner[1]];
  const Vec2& c = set[corner[2]];
  const float w = 1 - u - v;
  return {w * a.x + u * b.x + v * c.x, w * a.y + u * b.y + v * c.y};
}

namespace {

const Texture* base_color_texture(const Scene& scene, const Material& material) {
  const int index = material.base_color_texture.texture;
  if (index < 0) return nullptr;
  const Texture& texture = scene.textures[static_cast<size_t>(index)];
  return texture.rgba.empty() ? nullptr : &texture;
}

const Material& material_of(const Scene& scene, const SurfaceMesh& mesh) {
  return scene.materials[static_cast<size_t>(mesh.material)];
}

}  // namespace

float surface_alpha(const Scene& scene, const SurfaceMesh& mesh, uint32_t triangle, float u,
                    float v, uint64_t* texture_reads) {
  const Material& material = material_of(scene, mesh);
  float alpha = material.alpha;
  if (const Texture* texture = base_color_texture(scene, material)) {
    const TextureSlot& slot = material.base_color_texture;
    const Vec2 uv = interpolate_texcoord(mesh, slot.texcoord, triangle, u, v);
    alpha *= sample_texture_alpha(*texture, transform_texcoord(slot, uv));
    ++*texture_reads;
  }
  if (!mesh.colors.empty()) {
    const auto& corner = mesh.triangles[triangle];
    alpha *= (1 - u - v) * mesh.colors[corner[0]][3] + u * mesh.colors[corner[1]][3] +
             v * mesh.colors[corner[2]][3];
  }
  return alpha;
}

bool needs_alpha_test(const Scene& scene, const SurfaceMesh& mesh) {
  if (mesh.material < 0) return false;
  const Material& material = material_of(scene, mesh);
  if (material.alpha_mode != AlphaMode::mask) return false;
  float lowest = material.alpha;
  if (const Texture* texture = base_color_texture(scene, material)) {
    uint8_t least = 255;
    for (size_t i = 3; i < texture->rgba.size(); i += 4) least = std::min(least, texture->rgba[i]);
    lowest *= static_cast<float>(least) / 255.0f;
  }
  if (!mesh.colors.empty()) {
    float least = mesh.colors[0][3];
    for (const auto& color : mesh.colors) least = std::min(least, color[3]);
    lowest *= least;
  }
  return lowest < material.alpha_cutoff;
}

}  // namespace lightkiln

#pragma once

// Texture look-ups with wrapping and KHR_texture_transform.

#include <cstdint>

#include "core/scene/scene.h"

namespace lightkiln {

struct Vec4 {
  float x = 0, y = 0, z = 0, w = 0;
};

// uv' = offset + R(rotation) (scale uv). KHR_texture_transform rotates texture coordinates
// counter-clockwise as seen with v pointing down, so that
//   u' =  cos(r) u + sin(r) v,   v' = -sin(r) u + cos(r) v.
Vec2 transform_texcoord(const TextureSlot& slot, const Vec2& uv);

// Which of `size` texels in a row or column any index reads.
int64_t wrap_index(int64_t index, int64_t size, WrapMode mode);

// (r, g, b, a) at texture coordinate uv: colour decoded from sRGB to linear before filtering, alpha
// linear in [0, 1]. Nearest or bilinear as the texture says; (0, 0) is the upper left corner of
// the first texel. A coordinate that is not finite reads (0, 0). The texture has texels.
Vec4 sample_texture(const Texture& texture, const Vec2& uv);

// The fourth component alone, without decoding colour.
float sample_texture_alpha(const Texture& texture, const Vec2& uv);

// The texture coordinate of set `texcoord` at a barycentric point (u, v) of a triangle; (0, 0) when
// the mesh has no such set.
Vec2 interpolate_texcoord(const SurfaceMesh& mesh, int texcoord, uint32_t triangle, float u,
                          float v);

// Opacity at a point of a surface: factor x texture x vertex colour, in [0, 1] for valid files.
// `texture_reads` grows by one for a texture look-up.
float surface_alpha(const Scene& scene, const SurfaceMesh& mesh, uint32_t triangle, float u,
                    float v, uint64_t* texture_reads);

// True when some point of the mesh can fail its material's alpha test: MASK with a factor, texel
// and vertex colour whose product falls below the cutoff.
bool needs_alpha_test(const Scene& scene, const SurfaceMesh& mesh);

}  // namespace lightkiln

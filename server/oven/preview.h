#pragma once

// Small pictures of a job's images, for people who look at a page.

#include <vector>

#include "core/bake/bake.h"

namespace lightkiln {

inline constexpr int kMaxPreviewSide = 512;  // texels
inline constexpr size_t kMaxPreviews = 64;   // of a job: its first images, in order

// A PNG "<name>.png" with role "preview" for each of the first kMaxPreviews OpenEXR artifacts.
std::vector<Artifact> make_previews(const std::vector<Artifact>& artifacts);

// Box-filtered down so that no side exceeds `max_side`; never enlarged.
Image shrink(const Image& image, int max_side);

}  // namespace lightkiln

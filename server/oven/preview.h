#pragma once

// Small pictures of a job's images, for people who look at a page.

#include <span>
#include <vector>

#include "core/bake/bake.h"

namespace lightkiln {

// A PNG "<name>.png" with role "preview" for each picture, in their order; made on `threads`
// threads (0 = one per processor), on which the bytes do not depend.
std::vector<Artifact> make_previews(std::span<const Picture> pictures, int threads,
                                    Progress& progress);

}  // namespace lightkiln

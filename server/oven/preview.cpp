#include "server/oven/preview.h"

#include "core/base/parallel.h"
#include "core/image/decode.h"
#include "core/image/ldr.h"

namespace lightkiln {

std::vector<Artifact> make_previews(std::span<const Picture> pictures, int threads,
                                    Progress& progress) {
  std::vector<Artifact> previews(pictures.size());
  parallel_blocks(
      pictures.size(), 1, threads, progress,
      [&](size_t i, size_t) {
        previews[i] = {pictures[i].artifact + ".png", "preview", "image/png",
                       write_png(tonemap(pictures[i].pixels, {}))};
      },
      1, 1);
  return previews;
}

}  // namespace lightkiln

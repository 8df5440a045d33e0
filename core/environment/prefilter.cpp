#include "core/environment/prefilter.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>

#include "core/base/parallel.h"
#include "core/environment/bright_light.h"
#include "core/environment/near_field.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

LatlongSpectrum project_for(const Environment& environment, std::span<const LobePlan> lobes,
                            int sh_bands, int threads, Progress& progress) {
  std::vector<double> weights(static_cast<size_t>(sh_bands), 1.0);
  for (const LobePlan& lobe : lobes) {
    if (weights.size() < lobe.responses.size()) weights.resize(lobe.responses.size());
    for (size_t l = 0; l < lobe.responses.size(); ++l) {
      weights[l] = std::max(weights[l], std::abs(lobe.responses[l]));
    }
  }
  const int points = row_gauss_points(environment.radiance.height, weights, 1e-8);
  return project_latlong(environment.radiance, static_cast<int>(weights.size()), points, threads,
                         progress);
}

namespace {

// All that one level is read from.
struct Parts {
  RingGrid grid;
  std::optional<CutLight> cut;
  std::optional<NearField> near;

  Vec3d at(const Vec3d& direction, NearField::Workspace& work) const {
    Vec3d value = grid.interpolate(direction);
    if (cut) value += cut->at(direction);
    if (near) value += near->at(direction, work);
    return value;
  }
};

}  // namespace

Image convolve_lobe(const Environment& environment, const LightStatistics& light,
                    const LatlongSpectrum& spectrum, const LobePlan& lobe, int face_size,
                    int threads, Progress& progress, RangeReport* range) {
  Parts parts{synthesise_rings(spectrum, lobe.responses, convolution_rings(lobe.bands),
                               convolution_longitudes(lobe.bands), threads, progress),
              {},
              {}};
  if (lobe.corrected) parts.cut.emplace(light, *make_kernel(lobe.lobe), lobe.responses);
  if (lobe.split > 0) {
    parts.near.emplace(environment.radiance, lobe.lobe.alpha, lobe.split, lobe.tolerance);
  }
  Image cube(face_size, 6 * face_size, 3);
  RangeReport report;
  std::mutex mutex;
  parallel_blocks(
      static_cast<size_t>(cube.height), 8, threads, progress, [&](size_t begin, size_t end) {
        RangeReport mine;
        NearField::Workspace work;
        for (size_t row = begin; row < end; ++row) {
          const int line = static_cast<int>(row);
          for (int x = 0; x < face_size; ++x) {
            const Vec3d value = parts.at(
                cube_texel_direction(line / face_size, x, line % face_size, face_size), work);
            double most = 0;
            for (int c = 0; c < 3; ++c) {
              const double inside =
                  lobe.within_range
                      ? std::clamp(value[c], double(light.lowest[c]), double(light.highest[c]))
                      : value[c];
              most = std::max(most, std::abs(inside - value[c]) / light.mean_luminance);
              cube.at(x, line)[c] = static_cast<float>(inside);
            }
            mine.texels += most > 0;
            mine.most = std::max(mine.most, most);
          }
        }
        const std::lock_guard lock(mutex);
        report.texels += mine.texels;
        report.most = std::max(report.most, mine.most);
      });
  if (range) *range = report;
  return cube;
}

}  // namespace lightkiln

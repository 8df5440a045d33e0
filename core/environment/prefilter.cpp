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

// By Parseval a level's rms error is the root of sum_l (h_l b_l)^2, b_l the error of a band. The
// error of n points falls faster than any power once n is above half the highest band's phase over
// a row, so that some number is enough; on maps of few rows it is large, and so are the steps.
int row_points(int height, std::span<const LobePlan> lobes, const ShNeed& sh) {
  for (int points = 1;; points += 1 + points / 8) {
    bool enough = sh.bands == 0 || row_band_error(points, sh.bands - 1, height) <= sh.error;
    for (size_t i = 0; i < lobes.size() && enough; ++i) {
      double squares = 0;
      for (size_t l = 0; l < lobes[i].responses.size(); ++l) {
        const double error = row_band_error(points, static_cast<int>(l), height);
        squares += error * error * lobes[i].responses[l] * lobes[i].responses[l];
      }
      enough = std::sqrt(squares) <= lobes[i].row_error;
    }
    if (enough) return points;
  }
}

LatlongSpectrum project_for(const Environment& environment, std::span<const LobePlan> lobes,
                            const ShNeed& sh, int threads, Progress& progress) {
  int bands = std::max(1, sh.bands);
  for (const LobePlan& lobe : lobes) {
    bands = std::max(bands, static_cast<int>(lobe.responses.size()));
  }
  const int points = row_points(environment.radiance.height, lobes, sh);
  return project_latlong(environment.radiance, bands, points, threads, progress);
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
  if (lobe.corrected) {
    parts.cut.emplace(light, *make_kernel(lobe.lobe), lobe.responses, lobe.cell_phase);
  }
  if (lobe.split > 0) {
    parts.near.emplace(environment.radiance, lobe.lobe.alpha, lobe.split, lobe.tolerance);
  }
  Image cube(face_size, 6 * face_size, 3);
  const Rotation turn = environment.pending;
  const bool turned = !turn.is_identity();
  RangeReport report;
  std::mutex mutex;
  parallel_blocks(
      static_cast<size_t>(cube.height), 8, threads, progress, [&](size_t begin, size_t end) {
        RangeReport mine;
        NearField::Workspace work;
        for (size_t row = begin; row < end; ++row) {
          const int line = static_cast<int>(row);
          for (int x = 0; x < face_size; ++x) {
            const Vec3d direction =
                cube_texel_direction(line / face_size, x, line % face_size, face_size);
            const Vec3d value = parts.at(turned ? turn.undo(direction) : direction, work);
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

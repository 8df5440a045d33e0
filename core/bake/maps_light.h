#pragma once

// What the outputs of one environment_maps bake share: the map as they see it, what is known of its
// light, and its coefficients, each made when the first output asks for it.

#include <memory>
#include <optional>
#include <span>

#include "core/environment/layout_convert.h"
#include "core/environment/prefilter.h"
#include "core/environment/sun_extraction.h"
#include "core/trace/tracer.h"

namespace lightkiln {

class MapsLight {
 public:
  // With `sun` the source that it describes is taken out of the map first.
  explicit MapsLight(Environment environment, int threads,
                     const std::optional<SunOptions>& sun = {});

  // What outputs are made of: the map without a sun that was taken out.
  const Environment& environment() const { return environment_; }
  // None when it was not ordered.
  const std::optional<SunExtraction>& sun() const { return sun_; }
  // Every texel is equal: no output needs statistics or coefficients.
  bool constant() const { return environment_.constant; }
  int threads() const { return threads_; }

  const LightStatistics& statistics();
  bool measured() const { return statistics_.has_value(); }

  // What other layouts are converted from. Points into this object, which stays where it is from
  // then on.
  const ConversionSource& conversion_source();

  // What all outputs of the bake need together, so that coefficients do not depend on which output
  // comes first.
  void require(const ShNeed& sh, std::span<const LobePlan> lobes);
  // Bands that require() asked for; 0 = none.
  int bands() const;
  // Gauss points that each row is summed with for them.
  int row_points() const;
  const LatlongSpectrum& spectrum(Progress& progress);

  // What outputs cost the map; outputs count their own work, and whoever bakes them takes it.
  RayCounters& counters() { return counters_; }

 private:
  Environment environment_;
  std::optional<SunExtraction> sun_;
  int threads_;
  RayCounters counters_;
  std::optional<LightStatistics> statistics_;
  std::unique_ptr<const ConversionSource> conversion_source_;
  ShNeed sh_;
  std::vector<LobePlan> lobes_;
  std::optional<LatlongSpectrum> spectrum_;
};

}  // namespace lightkiln

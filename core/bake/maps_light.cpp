#include "core/bake/maps_light.h"

#include <algorithm>

namespace lightkiln {

MapsLight::MapsLight(Environment environment, int threads, const std::optional<SunOptions>& sun)
    : environment_(std::move(environment)), threads_(threads) {
  if (!sun) return;
  sun_ = extract_sun(environment_, *sun);
  sun_->disk.direction = environment_.pending.apply(sun_->disk.direction);
}

const LightStatistics& MapsLight::statistics() {
  if (!statistics_) statistics_ = measure_light(environment_);
  return *statistics_;
}

const ConversionSource& MapsLight::conversion_source() {
  if (!conversion_source_) {
    conversion_source_ = std::make_unique<const ConversionSource>(
        environment_.source_image_layout(), environment_.source_image());
  }
  return *conversion_source_;
}

void MapsLight::require(const ShNeed& sh, std::span<const LobePlan> lobes) {
  sh_ = sh;
  lobes_.assign(lobes.begin(), lobes.end());
  spectrum_.reset();
}

int MapsLight::bands() const {
  int bands = sh_.bands;
  for (const LobePlan& lobe : lobes_) bands = std::max(bands, lobe.bands);
  return bands;
}

int MapsLight::row_points() const {
  return lightkiln::row_points(environment_.radiance.height, lobes_, sh_);
}

const LatlongSpectrum& MapsLight::spectrum(Progress& progress) {
  if (!spectrum_) {
    spectrum_ = project_for(environment_, lobes_, sh_, threads_, progress);
    counters_.projected_texels += environment_.radiance.pixels.size() / 3;
  }
  return *spectrum_;
}

}  // namespace lightkiln

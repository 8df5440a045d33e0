#include "core/bake/maps_cube.h"

#include <algorithm>
#include <cmath>

#include "core/bake/maps_cost.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/environment/bright_light.h"
#include "core/environment/brute_force.h"
#include "core/environment/near_field.h"
#include "core/environment/resample.h"
#include "core/sphere/direction_map.h"

namespace lightkiln {

ConvolvedCube::ConvolvedCube(MapsLight& light, int size, std::optional<Lobe> lobe, double scale,
                             double target)
    : size_(size), lobe_(lobe), scale_(scale), constant_(light.constant()) {
  if (constant_) return;
  if (lobe_)
    plan_ = plan_lobe(light.statistics(), *lobe_, target);
  else if (!light.environment().pending.is_identity())
    turned_ = plan_turned_cube(light.environment(), ordered_error(target));
  else
    rounding_ = kResampleRounding * std::hypot(1, light.statistics().spread);
}

double ConvolvedCube::error_bound() const {
  if (constant_) return 0;
  if (turned_) return turned_->error_bound;
  return lobe_ ? plan_.error_bound : rounding_;
}

SpectrumNeed ConvolvedCube::spectrum_need() const {
  return {{}, plan_.bands > 0 ? &plan_ : nullptr};
}

double ConvolvedCube::model_seconds(MapsLight& light) const {
  if (constant_) return 0;
  const Image& map = light.environment().radiance;
  const double texels = 6.0 * size_ * size_;
  if (turned_) {
    const ConversionSource source(make_layout(LayoutKind::latlong, map.width), map);
    return conversion_seconds(estimate_conversion(
        source, make_layout(LayoutKind::cube_strip, size_), light.environment().pending,
        MapFilter::area, turned_->conversion_error));
  }
  if (!lobe_) return kResamplePerCell * (map.width + 4.0 * size_) * (map.height + 2.0 * size_);
  const double cut = plan_.bands;
  const double points =
      double(convolution_rings(plan_.bands)) * convolution_longitudes(plan_.bands);
  double seconds = kRingPerTerm * cut * cut * cut + kRingPerPoint * points + kPerTexel * texels;
  if (plan_.corrected) {
    seconds += kPerBrightPoint * texels *
               cut_light_points(light.statistics(), plan_.bands, plan_.cell_phase);
  }
  if (plan_.split > 0) {
    seconds += kPerCorePoint * texels *
               NearField(map, lobe_->alpha, plan_.split, plan_.tolerance).typical_points();
  }
  return seconds;
}

Image ConvolvedCube::make_cube(MapsLight& light, Progress& progress) const {
  if (!constant_) light.counters().cube_texels += 6 * uint64_t(size_) * uint64_t(size_);
  if (turned_) {
    return turn_to_cube(light.environment(), *turned_, size_, light.threads(), progress);
  }
  if (!constant_ && !lobe_) {
    return resample_to_cube(light.environment().radiance, size_, light.threads(), progress);
  }
  Image cube(size_, 6 * size_, 3);
  if (constant_) {
    const Vec3 radiance = to_float(light.environment().mean);
    for (size_t i = 0; i < cube.pixels.size(); i += 3) std::copy_n(&radiance.x, 3, &cube.pixels[i]);
  } else {
    cube = convolve_lobe(light.environment(), light.statistics(), light.spectrum(progress), plan_,
                         size_, light.threads(), progress);
  }
  if (scale_ != 1) {
    for (float& value : cube.pixels) value = static_cast<float>(scale_ * double(value));
  }
  return cube;
}

CheckedTexels::CheckedTexels(int count, int face_size_) : face_size(face_size_) {
  const size_t side = static_cast<size_t>(face_size);
  for (int i = 0; i < count; ++i) {
    const size_t index = check_index(i, 6 * side * side);
    texels.push_back({static_cast<int>(index % side), static_cast<int>(index / side)});
  }
}

std::vector<Vec3d> CheckedTexels::directions(const Rotation& turn) const {
  std::vector<Vec3d> all;
  for (const auto& [x, line] : texels) {
    all.push_back(
        turn.undo(cube_texel_direction(line / face_size, x, line % face_size, face_size)));
  }
  return all;
}

MeasuredError CheckedTexels::compare(const Image& cube, const LobeAverages& truths, double factor,
                                     double scale) const {
  ErrorMeter meter(scale, truths.error * factor);
  for (size_t i = 0; i < texels.size(); ++i) {
    meter.add(to_double(cube.rgb(texels[i].x, texels[i].line)), truths.means[i] * factor);
  }
  return meter.result();
}

namespace {

// Four times the meridians leave a sixteenth of the error: what the first sum differs by from the
// second is nearly all its own, fifteen times that of the second.
LobeAverages slow_texels(MapsLight& light, const CheckedTexels& checked, Progress& progress) {
  const size_t count = checked.texels.size();
  std::vector<Vec3d> coarse(count);
  LobeAverages truths{std::vector<Vec3d>(count), 0};
  const int size = checked.face_size;
  parallel_blocks(
      count, 1, light.threads(), progress,
      [&](size_t i, size_t) {
        const auto& [x, line] = checked.texels[i];
        const auto average = [&, x = x, line = line](int meridians) {
          return texel_average(light.environment(), line / size, x, line % size, size, meridians);
        };
        coarse[i] = average(16);
        truths.means[i] = average(64);
      },
      1, 1);
  for (size_t i = 0; i < count; ++i) {
    const Vec3d change = truths.means[i] - coarse[i];
    for (int c = 0; c < 3; ++c) truths.error = std::max(truths.error, std::abs(change[c]) / 15);
  }
  return truths;
}

}  // namespace

MeasuredError ConvolvedCube::check(MapsLight& light, const Image& cube, int count,
                                   Progress& progress) const {
  const CheckedTexels checked(count, size_);
  const LobeAverages truths = lobe_ ? lobe_averages(light.environment(), *make_twin_lobe(*lobe_),
                                                    checked.directions(light.environment().pending),
                                                    light.threads(), progress)
                                    : slow_texels(light, checked, progress);
  return checked.compare(cube, truths, scale_, scale_ * luminance(light.environment().mean));
}

MeasuredError ConvolvedCube::make(MapsLight& light, int check_texels, ByteWriter& writer,
                                  Progress& progress) const {
  const Image cube = make_cube(light, progress);
  writer.floats(cube.pixels);
  return constant_ ? MeasuredError{} : check(light, cube, check_texels, progress);
}

Image ConvolvedCube::read(ByteReader& reader) const {
  Image cube(size_, 6 * size_, 3);
  reader.floats(cube.pixels);
  return cube;
}

}  // namespace lightkiln

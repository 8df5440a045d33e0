#include "core/environment/environment.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/environment/layout_convert.h"
#include "core/image/decode.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

Image to_rgb(Image source) {
  if (source.channels == 3) return source;
  Image rgb(source.width, source.height, 3);
  for (int y = 0; y < source.height; ++y) {
    for (int x = 0; x < source.width; ++x) {
      const Vec3 value = source.rgb(x, y);
      std::copy_n(&value.x, 3, rgb.at(x, y));
    }
  }
  return rgb;
}

// The whole columns that a turn about +Y moves a lat-long map to the left, or nothing. A yaw of
// +90 degrees brings what stood at +Z (the centre) to +X (a quarter left of it).
std::optional<int> whole_columns(const MapLayout& layout, const Rotation& rotation) {
  if (layout.kind != LayoutKind::latlong || layout.convention != TexelConvention::half_texel) {
    return std::nullopt;
  }
  if (rotation.rows[1][1] != 1) return std::nullopt;
  const double turn = std::atan2(rotation.rows[0][2], rotation.rows[2][2]) / (2 * kPi);
  const double columns = std::nearbyint(turn * layout.width);
  if (std::abs(turn * layout.width - columns) > 1e-9 * layout.width) return std::nullopt;
  return (static_cast<int>(columns) + layout.width) % layout.width;
}

Image move_columns(const Image& source, int left) {
  Image moved(source.width, source.height, 3);
  for (int y = 0; y < source.height; ++y) {
    const float* row = source.at(0, y);
    std::rotate_copy(row, row + 3 * left, row + 3 * source.width, moved.at(0, y));
  }
  return moved;
}

// Fills in what follows from the pixels.
void summarise(Environment* environment) {
  const Image& image = environment->radiance;
  const Vec3 first = image.rgb(0, 0);
  environment->constant = true;
  Vec3d total;
  double brightest = 0;
  for (int y = 0; y < image.height; ++y) {
    Vec3d row;
    for (int x = 0; x < image.width; ++x) {
      const Vec3 value = image.rgb(x, y);
      if (value != first) environment->constant = false;
      row += to_double(value);
      brightest = std::max(brightest, luminance(to_double(value)));
    }
    total += row * latlong_texel_solid_angle(y, image.width, image.height);
  }
  environment->mean = environment->constant ? to_double(first) : total / (4 * kPi);
  environment->max_luminance = brightest;
}

void refuse_repairs(const PixelRepairs& repairs) {
  if (repairs.nan + repairs.infinite + repairs.negative == 0) return;
  throw Error(ErrorCode::invalid_input,
              "The environment holds values that strict refuses: " + std::to_string(repairs.nan) +
                  " NaN, " + std::to_string(repairs.infinite) + " infinite and " +
                  std::to_string(repairs.negative) + " negative.");
}

}  // namespace

MapLayout Environment::source_image_layout() const {
  return reduced ? make_layout(LayoutKind::latlong, radiance.width) : source_layout;
}

Environment make_environment(DecodedImage decoded, const SourceReading& reading,
                             const Rotation& rotation, int threads, Progress* progress) {
  Environment environment;
  environment.source_layout = source_layout(decoded, reading);
  environment.rotation = rotation;
  environment.covered_share = covered_solid_angle(environment.source_layout) / (4 * kPi);
  Image image = to_rgb(std::move(decoded.image));
  environment.repairs = sanitise(image);
  if (reading.strict) refuse_repairs(environment.repairs);
  if (reading.face_orientation == FaceOrientation::opengl &&
      environment.source_layout.kind == LayoutKind::cube_strip) {
    image = strip_from_opengl(image);
  }
  const bool turned = !rotation.is_identity();
  const std::optional<int> columns = whole_columns(environment.source_layout, rotation);
  if (columns && *columns == 0) {
    environment.radiance = std::move(image);
  } else {
    Progress silent;
    if (columns) {
      environment.radiance = move_columns(image, *columns);
    } else {
      const MapLayout& from = environment.source_layout;
      environment.conversion_error = reading.conversion_error;
      environment.radiance =
          convert_layout(ConversionSource(from, image),
                         make_layout(LayoutKind::latlong, holding_width(from, turned)), rotation,
                         MapFilter::adaptive, reading.conversion_error, threads,
                         progress != nullptr ? *progress : silent);
    }
    environment.source = std::move(image);
  }
  summarise(&environment);
  return environment;
}

Environment make_pending_environment(DecodedImage decoded, const SourceReading& reading,
                                     const Rotation& rotation, int threads, Progress* progress) {
  const bool moved = whole_columns(source_layout(decoded, reading), rotation).has_value();
  Environment environment = make_environment(std::move(decoded), reading,
                                             moved ? rotation : Rotation{}, threads, progress);
  if (!moved) environment.rotation = environment.pending = rotation;
  return environment;
}

Environment constant_environment(const Vec3& radiance) {
  Environment environment;
  environment.radiance = Image(1, 1, 3);
  std::copy_n(&radiance.x, 3, environment.radiance.at(0, 0));
  environment.repairs = sanitise(environment.radiance);
  environment.source_layout = make_layout(LayoutKind::latlong, 1);
  summarise(&environment);
  return environment;
}

Vec3 environment_radiance(const Environment& environment, const Vec3& direction) {
  const Image& image = environment.radiance;
  double u = 0, v = 0;
  latlong_coordinates(to_double(direction), &u, &v);
  const int x = std::min(static_cast<int>(u * image.width), image.width - 1);
  const int y = std::min(static_cast<int>(v * image.height), image.height - 1);
  return image.rgb(x, y);
}

}  // namespace lightkiln

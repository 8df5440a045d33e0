#include "core/environment/environment.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/base/error.h"
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

// OpenEXR's lat-long standard puts the centres of the outermost pixels on longitudes +-pi and
// latitudes +-pi/2, so its pixel (x, y) samples u = x / (W - 1), v = y / (H - 1). Texel (i, j) of
// our grid looks at u = (i + 1/2) / W: bilinear interpolation between the four samples around it.
Image from_border_texels(const Image& source) {
  Image result(source.width, source.height, 3);
  for (int j = 0; j < source.height; ++j) {
    const double y = (j + 0.5) / source.height * (source.height - 1);
    const int y0 = std::min(static_cast<int>(y), std::max(source.height - 2, 0));
    const int y1 = std::min(y0 + 1, source.height - 1);
    const float fy = static_cast<float>(y - y0);
    for (int i = 0; i < source.width; ++i) {
      const double x = (i + 0.5) / source.width * (source.width - 1);
      const int x0 = std::min(static_cast<int>(x), std::max(source.width - 2, 0));
      const int x1 = std::min(x0 + 1, source.width - 1);
      const float fx = static_cast<float>(x - x0);
      const Vec3 top = source.rgb(x0, y0) * (1 - fx) + source.rgb(x1, y0) * fx;
      const Vec3 bottom = source.rgb(x0, y1) * (1 - fx) + source.rgb(x1, y1) * fx;
      const Vec3 value = top * (1 - fy) + bottom * fy;
      std::copy_n(&value.x, 3, result.at(i, j));
    }
  }
  return result;
}

void check_shape(const DecodedImage& decoded) {
  const Image& image = decoded.image;
  const std::string size = std::to_string(image.width) + " x " + std::to_string(image.height);
  if (decoded.envmap == EnvmapAttribute::cube) {
    throw Error(ErrorCode::invalid_input,
                "The environment is a cube map (" + size +
                    " pixels, `envmap` attribute); a lat-long map, twice as wide as high, is "
                    "needed here.");
  }
  const bool single = image.width == 1 && image.height == 1;
  if (image.width < 1 || image.height < 1 || (image.width != 2 * image.height && !single)) {
    throw Error(ErrorCode::invalid_input, "The environment is " + size +
                                              " pixels; a lat-long map covers the whole sphere "
                                              "and is exactly twice as wide as high.");
  }
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

}  // namespace

Environment make_environment(DecodedImage decoded) {
  check_shape(decoded);
  Environment environment;
  environment.radiance = to_rgb(std::move(decoded.image));
  environment.repairs = sanitise(environment.radiance);
  if (decoded.envmap == EnvmapAttribute::latlong) {
    environment.radiance = from_border_texels(environment.radiance);
  }
  summarise(&environment);
  return environment;
}

Environment constant_environment(const Vec3& radiance) {
  Environment environment;
  environment.radiance = Image(1, 1, 3);
  std::copy_n(&radiance.x, 3, environment.radiance.at(0, 0));
  environment.repairs = sanitise(environment.radiance);
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

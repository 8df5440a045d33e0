// Sources: Karis, "RGBM color encoding", 2009 (comment on RGBD); Khronos Group,
// EXT_lights_image_based, README (which leaves the colour space of RGB open); Babylon.js 9,
// helperFunctions shader (toRGBD and fromRGBD: the power 2.2, the divisor in whole steps of 1/255).

#include "core/image/rgbd.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace lightkiln {

namespace {

constexpr double kGamma = 2.2;

// The colour of each code.
const std::array<double, 256>& colours() {
  static const auto table = [] {
    std::array<double, 256> values{};
    for (size_t i = 0; i < values.size(); ++i)
      values[i] = std::pow(static_cast<double>(i) / 255, kGamma);
    return values;
  }();
  return table;
}

// The code whose colour is nearest.
uint8_t code_of(double colour) {
  const auto& table = colours();
  const auto above = std::lower_bound(table.begin() + 1, table.end() - 1, colour);
  const auto nearest = *above - colour < colour - *(above - 1) ? above : above - 1;
  return static_cast<uint8_t>(nearest - table.begin());
}

// With m the largest channel, colour = value a/255 stays at or below 1 for a <= 255/m; the largest
// whole number in 1..255 that does is a = floor(255/m).
std::array<uint8_t, 4> encode(const Vec3d& value) {
  const double largest = std::max({value.x, value.y, value.z});
  const int divisor = largest > 1 ? std::max(static_cast<int>(255 / largest), 1) : 255;
  std::array<uint8_t, 4> rgbd{};
  for (int c = 0; c < 3; ++c) {
    rgbd[static_cast<size_t>(c)] = code_of(std::min(value[c] * divisor / 255, 1.0));
  }
  rgbd[3] = static_cast<uint8_t>(divisor);
  return rgbd;
}

}  // namespace

Vec3d decode_rgbd(const uint8_t* rgbd) {
  const auto& table = colours();
  return Vec3d{table[rgbd[0]], table[rgbd[1]], table[rgbd[2]]} / (rgbd[3] / 255.0);
}

Image8 encode_rgbd(const Image& image, RgbdLoss* loss) {
  assert(image.channels == 3);
  Image8 packed;
  packed.width = image.width;
  packed.height = image.height;
  packed.channels = 4;
  packed.pixels.reserve(image.pixels.size() / 3 * 4);
  RgbdLoss found;
  double squares = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      Vec3d value = to_double(image.rgb(x, y));
      const double largest = std::max({value.x, value.y, value.z});
      if (largest > kMaxRgbd) {
        const Vec3d kept = value * (kMaxRgbd / largest);
        found.cut_off += (value.x - kept.x) + (value.y - kept.y) + (value.z - kept.z);
        value = kept;
        ++found.cut;
      }
      const std::array<uint8_t, 4> rgbd = encode(value);
      packed.pixels.insert(packed.pixels.end(), rgbd.begin(), rgbd.end());
      const Vec3d error = decode_rgbd(rgbd.data()) - value;
      squares += dot(error, error);
      found.largest =
          std::max({found.largest, std::abs(error.x), std::abs(error.y), std::abs(error.z)});
    }
  }
  found.rms = std::sqrt(squares / static_cast<double>(std::max<size_t>(image.pixels.size(), 1)));
  if (loss) *loss = found;
  return packed;
}

}  // namespace lightkiln

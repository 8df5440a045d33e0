// Source of the tone curve: Khronos Group, "Khronos PBR Neutral Tone Mapper", 2024.

#include "core/image/decode.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "core/base/error.h"
#include "core/image/ldr.h"
#include "core/image/radiance_hdr.h"

namespace lightkiln {

namespace {

bool begins_with(std::span<const std::byte> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

// What a file that is no HDR image seems to be, for the refusal.
std::string found_instead(std::span<const std::byte> bytes) {
  constexpr struct {
    std::string_view magic, name;
  } kKnown[] = {
      {"\x89PNG", "a PNG image"}, {"\xff\xd8\xff", "a JPEG image"},
      {"glTF", "a GLB scene"},    {"\xabKTX", "a KTX texture"},
      {"DDS ", "a DDS texture"},  {"II*", "a TIFF image"},
      {"MM", "a TIFF image"},     {"PF", "a PFM image"},
      {"{", "a JSON text"},
  };
  if (bytes.empty()) return "an empty file";
  for (const auto& known : kKnown)
    if (begins_with(bytes, known.magic)) return std::string(known.name);
  return "a file of an unknown kind";
}

// The curve leaves the dark part straight, minus the 4 % that a dielectric reflects head-on, and
// bends the peak above 0.76 towards 1 by new_peak = 1 - d^2 / (peak + d - start), d = 1 - start,
// while colours above it fade to white.
Vec3d khronos_pbr_neutral(Vec3d color) {
  constexpr double kStart = 0.8 - 0.04, kDesaturation = 0.15;
  const double least = std::min({color.x, color.y, color.z});
  const double offset = least < 0.08 ? least - 6.25 * least * least : 0.04;
  color -= Vec3d{offset, offset, offset};
  const double peak = std::max({color.x, color.y, color.z});
  if (peak < kStart) return color;
  constexpr double kRest = 1 - kStart;
  const double new_peak = 1 - kRest * kRest / (peak + kRest - kStart);
  color *= new_peak / peak;
  const double white = 1 - 1 / (kDesaturation * (peak - new_peak) + 1);
  return color * (1 - white) + Vec3d{new_peak, new_peak, new_peak} * white;
}

double showable(double value) {
  return value > 0 ? std::min(value, double{std::numeric_limits<float>::max()}) : 0;
}

}  // namespace

DecodedImage decode_hdr_image(std::span<const std::byte> bytes) {
  if (begins_with(bytes, "\x76\x2f\x31\x01")) return read_exr(bytes);
  if (begins_with(bytes, "#?")) return read_radiance_hdr(bytes);
  throw Error(ErrorCode::invalid_input,
              "The environment image must be OpenEXR or Radiance HDR; "
              "this is " +
                  found_instead(bytes) + ".");
}

DecodedImage decode_light_image(std::span<const std::byte> bytes) {
  const bool ldr = begins_with(bytes, "\x89PNG") || begins_with(bytes, "\xff\xd8\xff");
  if (ldr) return read_ldr_as_light(bytes);
  const bool hdr = begins_with(bytes, "\x76\x2f\x31\x01") || begins_with(bytes, "#?");
  if (!hdr) {
    throw Error(ErrorCode::invalid_input,
                "The environment image must be OpenEXR, Radiance HDR, PNG or JPEG; this is " +
                    found_instead(bytes) + ".");
  }
  DecodedImage decoded = decode_hdr_image(bytes);
  frame_as_displayed(decoded);
  return decoded;
}

void frame_as_displayed(DecodedImage& decoded) {
  if (!decoded.display || decoded.envmap != EnvmapAttribute::none) return;
  const PixelWindow frame = *decoded.display;
  const Image& source = decoded.image;
  check_image_size(frame.width, frame.height, "The display window of an OpenEXR image");
  const int64_t left = std::max<int64_t>(frame.x, 0), top = std::max<int64_t>(frame.y, 0);
  const int64_t right = std::min<int64_t>(frame.x + frame.width, source.width);
  const int64_t bottom = std::min<int64_t>(frame.y + frame.height, source.height);
  if (right <= left || bottom <= top) {
    throw Error(ErrorCode::invalid_input,
                "The OpenEXR image holds no pixel of its display window: a map is read from the "
                "display window, unless the attribute envmap says that the data window is the "
                "map.");
  }
  Image framed(static_cast<int>(frame.width), static_cast<int>(frame.height), source.channels);
  for (int64_t y = top; y < bottom; ++y) {
    const float* from = source.at(static_cast<int>(left), static_cast<int>(y));
    std::copy_n(from, static_cast<size_t>(right - left) * static_cast<size_t>(source.channels),
                framed.at(static_cast<int>(left - frame.x), static_cast<int>(y - frame.y)));
  }
  const auto common = static_cast<uint64_t>((right - left) * (bottom - top));
  decoded.pixels_missing = static_cast<uint64_t>(frame.width * frame.height) - common;
  decoded.pixels_outside = static_cast<uint64_t>(int64_t{source.width} * source.height) - common;
  decoded.image = std::move(framed);
  decoded.display.reset();
}

std::vector<std::string> light_warnings(const DecodedImage& decoded) {
  std::vector<std::string> warnings;
  if (decoded.display_referred) {
    warnings.push_back("The environment (" + decoded.format +
                       ") was made for a screen: nothing in it is brighter than 1, so lamps and "
                       "the sun are missing from the light. An OpenEXR or Radiance HDR map holds "
                       "them.");
  }
  if (decoded.pixels_missing > 0) {
    warnings.push_back(std::to_string(decoded.pixels_missing) +
                       " pixels of the environment's display window are not in the file and count "
                       "as black.");
  }
  if (decoded.pixels_outside > 0) {
    warnings.push_back(std::to_string(decoded.pixels_outside) +
                       " pixels of the environment lie outside its display window and were "
                       "dropped.");
  }
  return warnings;
}

PixelRepairs sanitise(Image& image) {
  PixelRepairs repairs;
  for (float& value : image.pixels) {
    if (value >= 0 && value <= std::numeric_limits<float>::max()) continue;
    uint64_t& kind = std::isnan(value)   ? repairs.nan
                     : std::isinf(value) ? repairs.infinite
                                         : repairs.negative;
    ++kind;
    value = 0;
  }
  return repairs;
}

Image8 tonemap(const Image& image, const TonemapOptions& options) {
  const double scale = std::exp2(options.exposure_stops);
  Image8 shown;
  shown.width = image.width;
  shown.height = image.height;
  shown.channels = image.channels == 4 ? 4 : 3;
  shown.pixels.reserve(static_cast<size_t>(image.width) * static_cast<size_t>(image.height) *
                       static_cast<size_t>(shown.channels));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const Vec3 rgb = image.rgb(x, y);
      const Vec3d mapped = khronos_pbr_neutral(
          {showable(scale * rgb.x), showable(scale * rgb.y), showable(scale * rgb.z)});
      for (int c = 0; c < 3; ++c)
        shown.pixels.push_back(linear_to_srgb(static_cast<float>(mapped[c])));
      if (shown.channels == 4) {
        const double alpha = std::clamp(showable(image.at(x, y)[3]), 0.0, 1.0);
        shown.pixels.push_back(static_cast<uint8_t>(std::lround(255 * alpha)));
      }
    }
  }
  return shown;
}

}  // namespace lightkiln

// Source: IEC 61966-2-1 (sRGB).

#include "core/image/ldr.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string_view>

#include "core/base/error.h"
#include "core/image/ldr_check.h"

namespace {

// The decoder grows its buffers as the file asks; this stops one that asks for more than any image
// of the stated size can need.
thread_local size_t g_largest_allocation = 0;
thread_local bool g_asked_for_more = false;

bool allowed(size_t size) {
  if (size > g_largest_allocation) g_asked_for_more = true;
  return size <= g_largest_allocation;
}
void* limited_malloc(size_t size) {
  return allowed(size) ? std::malloc(size) : nullptr;
}
void* limited_realloc(void* memory, size_t size) {
  return allowed(size) ? std::realloc(memory, size) : nullptr;
}

}  // namespace

#define STBI_MALLOC(size) limited_malloc(size)
#define STBI_REALLOC(memory, size) limited_realloc(memory, size)
#define STBI_FREE(memory) std::free(memory)
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 16384
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

namespace lightkiln {

namespace {

[[noreturn]] void malformed(const std::string& format, const std::string& what) {
  throw Error(ErrorCode::invalid_input, "The " + format + " image is malformed: " + what + ".");
}

// encoded = linear <= 0.0031308 ? 12.92 linear : 1.055 linear^(1/2.4) - 0.055, and its inverse.
double srgb_decode(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}
double srgb_encode(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

const std::vector<float>& linear_of_16_bits() {
  static const auto table = [] {
    std::vector<float> values(65536);
    for (size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<float>(srgb_decode(static_cast<double>(i) / 65535));
    return values;
  }();
  return table;
}

// Checked, measured and within the limits; the decoder may run.
struct LdrSource {
  LdrFacts facts;
  std::string format;
  const stbi_uc* data = nullptr;
  int size = 0, width = 0, height = 0;
};

LdrSource open_ldr(std::span<const std::byte> bytes, const LdrFacts& facts) {
  LdrSource source;
  source.facts = facts;
  source.format = source.facts.png ? "PNG" : "JPEG";
  // Held far below what the decoder's int can count.
  if (bytes.size() > size_t{1} << 30)
    throw Error(ErrorCode::too_large, "The " + source.format + " image is larger than 1 GiB.");
  source.data = reinterpret_cast<const stbi_uc*>(bytes.data());
  source.size = static_cast<int>(bytes.size());
  g_largest_allocation = size_t{1} << 20;  // more than reading a header takes
  g_asked_for_more = false;
  int channels = 0;
  if (!stbi_info_from_memory(source.data, source.size, &source.width, &source.height, &channels))
    malformed(source.format, stbi_failure_reason());
  check_image_size(source.width, source.height, "A " + source.format + " image");
  // The largest buffer is the unpacked 16-bit RGBA or the file itself, doubled as it grows; blocks
  // of up to 32 pixels overhang at the edges.
  g_largest_allocation =
      2 * bytes.size() + (size_t{1} << 20) +
      16 * (static_cast<size_t>(source.width) + 64) * (static_cast<size_t>(source.height) + 64);
  return source;
}

template <typename T>
using Decoded = std::unique_ptr<T, void (*)(void*)>;

template <typename T>
Decoded<T> decode(const LdrSource& source, int channels,
                  T* (*load)(const stbi_uc*, int, int*, int*, int*, int)) {
  int width = 0, height = 0, stored = 0;
  Decoded<T> pixels(load(source.data, source.size, &width, &height, &stored, channels), std::free);
  if (!pixels && g_asked_for_more)
    malformed(source.format, "it unpacks to more than its size allows");
  const char* reason = pixels ? "" : stbi_failure_reason();
  if (!pixels && std::string_view(reason) == "outofmem") throw std::bad_alloc();
  if (!pixels) malformed(source.format, reason);
  return pixels;
}

// The encoding that a PNG image states, when it differs from sRGB by more than rounding.
void check_encoding(const LdrFacts& facts) {
  if (facts.components == 4) {
    throw Error(ErrorCode::unsupported,
                "The JPEG image has four components, as for printing (CMYK): convert it to RGB "
                "first.");
  }
  constexpr uint32_t kSrgbGamma = 45455;
  const uint32_t gamma = facts.gamma;
  if (gamma != 0 && (gamma < kSrgbGamma - 1000 || gamma > kSrgbGamma + 1000)) {
    throw Error(ErrorCode::unsupported, "The PNG image states a gamma of " + std::to_string(gamma) +
                                            "/100000: as light, only sRGB (45455) is read.");
  }
}

}  // namespace

Image8 read_ldr(std::span<const std::byte> bytes) {
  const LdrSource source = open_ldr(bytes, check_ldr(bytes));
  const Decoded<stbi_uc> pixels = decode<stbi_uc>(source, 4, stbi_load_from_memory);
  Image8 image;
  image.width = source.width;
  image.height = source.height;
  image.channels = 4;
  const size_t count = static_cast<size_t>(image.width) * static_cast<size_t>(image.height) * 4;
  image.pixels.assign(pixels.get(), pixels.get() + count);
  return image;
}

DecodedImage read_ldr_as_light(std::span<const std::byte> bytes) {
  const LdrFacts facts = check_ldr(bytes);
  check_encoding(facts);
  const LdrSource source = open_ldr(bytes, facts);
  DecodedImage decoded;
  decoded.display_referred = true;
  decoded.image = Image(source.width, source.height, 3);
  std::vector<float>& light = decoded.image.pixels;
  if (source.facts.png && stbi_is_16_bit_from_memory(source.data, source.size)) {
    decoded.format = "PNG, 16-bit sRGB";
    const Decoded<stbi_us> pixels = decode<stbi_us>(source, 3, stbi_load_16_from_memory);
    for (size_t i = 0; i < light.size(); ++i) light[i] = linear_of_16_bits()[pixels.get()[i]];
  } else {
    decoded.format = source.format + ", 8-bit sRGB";
    const Decoded<stbi_uc> pixels = decode<stbi_uc>(source, 3, stbi_load_from_memory);
    for (size_t i = 0; i < light.size(); ++i) light[i] = srgb_to_linear(pixels.get()[i]);
  }
  return decoded;
}

float srgb_to_linear(uint8_t encoded) {
  static const auto table = [] {
    std::array<float, 256> values{};
    for (size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<float>(srgb_decode(static_cast<double>(i) / 255));
    return values;
  }();
  return table[encoded];
}

uint8_t linear_to_srgb(float linear) {
  if (!(linear > 0)) return 0;
  const double encoded = srgb_encode(std::min(static_cast<double>(linear), 1.0));
  return static_cast<uint8_t>(std::lround(255 * encoded));
}

}  // namespace lightkiln

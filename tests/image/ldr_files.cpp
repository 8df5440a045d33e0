#include "tests/image/ldr_files.h"

#include <string>

#include <zlib.h>

#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace lightkiln::test {

Image8 pattern8(int width, int height, int channels) {
  Image8 image;
  image.width = width;
  image.height = height;
  image.channels = channels;
  uint32_t noise = 1;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        noise = noise * 1664525u + 1013904223u;
        const bool noisy = (x / 16 + y / 16) % 4 == 3;
        image.pixels.push_back(static_cast<uint8_t>(
            noisy ? noise >> 24 : static_cast<uint32_t>(2 * x + 3 * y + 40 * c)));
      }
    }
  }
  return image;
}

std::vector<std::byte> make_jpeg(const Image8& image) {
  std::vector<std::byte> bytes;
  stbi_write_jpg_to_func(
      [](void* context, void* data, int size) {
        const auto* begin = static_cast<const std::byte*>(data);
        auto* out = static_cast<std::vector<std::byte>*>(context);
        out->insert(out->end(), begin, begin + size);
      },
      &bytes, image.width, image.height, image.channels, image.pixels.data(), 95);
  return bytes;
}

namespace {

void append_number(std::vector<std::byte>& bytes, size_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::byte>(value >> shift & 255));
}

void append_chunk(std::vector<std::byte>& bytes, const std::string& type,
                  const std::vector<uint8_t>& data) {
  append_number(bytes, data.size());
  const size_t begin = bytes.size();
  for (const char c : type) bytes.push_back(static_cast<std::byte>(c));
  for (const uint8_t value : data) bytes.push_back(static_cast<std::byte>(value));
  append_number(bytes,
                crc32_z(0, reinterpret_cast<const Bytef*>(&bytes[begin]), bytes.size() - begin));
}

}  // namespace

std::vector<std::byte> make_png(const PngRecipe& recipe, const std::vector<uint8_t>& rows) {
  std::vector<std::byte> bytes;
  for (const int value : {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a})
    bytes.push_back(static_cast<std::byte>(value));
  std::vector<uint8_t> header;
  for (const int side : {recipe.width, recipe.height})
    for (int shift = 24; shift >= 0; shift -= 8)
      header.push_back(static_cast<uint8_t>(side >> shift & 255));
  for (const int value : {recipe.bits, recipe.color_type, 0, 0, 0})
    header.push_back(static_cast<uint8_t>(value));
  append_chunk(bytes, "IHDR", header);
  if (recipe.srgb_chunk) append_chunk(bytes, "sRGB", {0});
  if (recipe.gamma) {
    std::vector<uint8_t> gamma;
    for (int shift = 24; shift >= 0; shift -= 8)
      gamma.push_back(static_cast<uint8_t>(recipe.gamma >> shift & 255));
    append_chunk(bytes, "gAMA", gamma);
  }
  if (!recipe.palette.empty()) append_chunk(bytes, "PLTE", recipe.palette);
  if (!recipe.transparency.empty()) append_chunk(bytes, "tRNS", recipe.transparency);
  std::vector<uint8_t> filtered;
  const size_t row = rows.size() / static_cast<size_t>(recipe.height);
  for (size_t y = 0; y < static_cast<size_t>(recipe.height); ++y) {
    filtered.push_back(0);
    filtered.insert(filtered.end(), rows.begin() + static_cast<std::ptrdiff_t>(y * row),
                    rows.begin() + static_cast<std::ptrdiff_t>((y + 1) * row));
  }
  uLongf size = compressBound(filtered.size());
  std::vector<uint8_t> packed(size);
  compress(packed.data(), &size, filtered.data(), filtered.size());
  packed.resize(size);
  append_chunk(bytes, "IDAT", packed);
  append_chunk(bytes, "IEND", {});
  return bytes;
}

}  // namespace lightkiln::test

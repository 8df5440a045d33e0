#include "tests/image/ldr_files.h"

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

}  // namespace lightkiln::test

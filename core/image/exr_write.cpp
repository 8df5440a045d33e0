// Source: "Reading and Writing Image Files with the OpenEXR Library", Academy Software Foundation,
// version 3.1 (tiled files, multi-resolution levels).

#include <algorithm>
#include <cmath>

#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfTiledOutputFile.h>

#include "core/base/error.h"
#include "core/image/exr.h"
#include "core/image/exr_library.h"

namespace lightkiln {

namespace {

constexpr float kMaxHalf = 65504.0f;
constexpr int kTileSide = 64;
// At level 6 noisy floats take a tenth more time, smooth ones twice as much, for 1 % of the size.
constexpr int kZipLevel = 4;
// ZIP packs 50 MB a second and a core. Filtered radiance in 32-bit floats, whose lower bits are
// noise, shrinks by 1 to 8 % and is stored as it is.
constexpr double kPackedAtMost = 0.9;
constexpr int kZipRows = 16;  // that one block of a scan-line file holds
constexpr int kSampleBlocks = 4;

bool fits_half(const Image& image) {
  return std::none_of(image.pixels.begin(), image.pixels.end(), [](float value) {
    return std::isfinite(value) && std::abs(value) > kMaxHalf;
  });
}

const char* channel_name(int c, int channels) {
  return channels == 1 ? "Y" : &"R\0G\0B\0A"[2 * c];
}

Imf::Header header_for(const Image& image, const ExrWriteOptions& options, Imf::PixelType type) {
  Imf::Header header(image.width, image.height);
  header.zipCompressionLevel() = kZipLevel;
  Imf::addChromaticities(header, Imf::Chromaticities());  // the defaults are Rec. 709
  if (options.envmap != EnvmapAttribute::none) {
    Imf::addEnvmap(
        header, options.envmap == EnvmapAttribute::cube ? Imf::ENVMAP_CUBE : Imf::ENVMAP_LATLONG);
  }
  for (const auto& [name, text] : options.attributes)
    header.insert(name, Imf::StringAttribute(text));
  for (int c = 0; c < image.channels; ++c)
    header.channels().insert(channel_name(c, image.channels), Imf::Channel(type));
  return header;
}

template <typename T>
Imf::FrameBuffer buffer_of(const Image& image, const T* pixels, Imf::PixelType type) {
  const size_t pixel = sizeof(T) * static_cast<size_t>(image.channels);
  const Imath::Box2i window({0, 0}, {image.width - 1, image.height - 1});
  Imf::FrameBuffer buffer;
  for (int c = 0; c < image.channels; ++c) {
    buffer.insert(channel_name(c, image.channels),
                  Imf::Slice::Make(type, pixels + c, window, pixel,
                                   pixel * static_cast<size_t>(image.width)));
  }
  return buffer;
}

// Calls write(buffer) with the pixels in the type of the file.
template <typename Write>
void with_buffer(const Image& image, bool half_enough, Write&& write) {
  if (!half_enough) return write(buffer_of(image, image.pixels.data(), Imf::FLOAT));
  const std::vector<half> rounded(image.pixels.begin(), image.pixels.end());
  write(buffer_of(image, rounded.data(), Imf::HALF));
}

std::vector<std::byte> write_rows(const Image& image, const Imf::Header& header, bool half_enough,
                                  int threads) {
  ExrMemoryOutput stream;
  {
    Imf::OutputFile file(stream, header, exr_library_threads(threads));
    with_buffer(image, half_enough, [&](const Imf::FrameBuffer& buffer) {
      file.setFrameBuffer(buffer);
      file.writePixels(image.height);
    });
  }  // the offset table is written when the file closes
  return std::move(stream.bytes);
}

// ZIP where it makes a file of a few of the image's blocks small enough, else none.
Imf::Compression choose_compression(const Image& image, bool half_enough) {
  constexpr int kSampleRows = kSampleBlocks * kZipRows;
  if (image.height <= kSampleRows) return Imf::ZIP_COMPRESSION;
  Image sample(image.width, kSampleRows, image.channels);
  const int blocks = image.height / kZipRows;
  const size_t block = sample.offset(0, kZipRows);
  for (int i = 0; i < kSampleBlocks; ++i) {
    const int from = (2 * i + 1) * blocks / (2 * kSampleBlocks);
    std::copy_n(image.at(0, from * kZipRows), block, sample.at(0, i * kZipRows));
  }
  Imf::Header header = header_for(sample, {}, half_enough ? Imf::HALF : Imf::FLOAT);
  header.compression() = Imf::ZIP_COMPRESSION;
  const size_t packed = write_rows(sample, header, half_enough, 1).size();
  const size_t whole = sample.pixels.size() * (half_enough ? sizeof(half) : sizeof(float));
  return static_cast<double>(packed) <= kPackedAtMost * static_cast<double>(whole)
             ? Imf::ZIP_COMPRESSION
             : Imf::NO_COMPRESSION;
}

// The mean of `source` over the area of each pixel of an image half its size, rounded down: pixel x
// of the smaller one covers [x, x + 1) W / w of the larger one.
Image halved(const Image& source) {
  Image result(std::max(source.width / 2, 1), std::max(source.height / 2, 1), source.channels);
  const double across = double(source.width) / result.width;
  const double down = double(source.height) / result.height;
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      double sum[4] = {}, area = 0;
      const double left = x * across, right = left + across;
      const double top = y * down, bottom = top + down;
      for (int j = static_cast<int>(top); j < std::min<double>(source.height, bottom); ++j) {
        const double rows = std::min<double>(j + 1, bottom) - std::max<double>(j, top);
        for (int i = static_cast<int>(left); i < std::min<double>(source.width, right); ++i) {
          const double weight = rows * (std::min<double>(i + 1, right) - std::max<double>(i, left));
          const float* from = source.at(i, j);
          for (int c = 0; c < source.channels; ++c) sum[c] += weight * double(from[c]);
          area += weight;
        }
      }
      float* to = result.at(x, y);
      for (int c = 0; c < source.channels; ++c) to[c] = static_cast<float>(sum[c] / area);
    }
  }
  return result;
}

void check_levels(std::span<const Image> levels) {
  if (levels.empty())
    throw Error(ErrorCode::invalid_input, "A mip-mapped OpenEXR image needs at least one level.");
  const Image& first = levels[0];
  check_image_size(first.width, first.height, "An OpenEXR image");
  const int most = exr_level_count(first.width, first.height);
  if (levels.size() > static_cast<size_t>(most)) {
    throw Error(ErrorCode::invalid_input,
                "A mip-mapped OpenEXR image of " + std::to_string(first.width) + " x " +
                    std::to_string(first.height) + " pixels has at most " + std::to_string(most) +
                    " levels; " + std::to_string(levels.size()) + " are given.");
  }
  for (size_t i = 1; i < levels.size(); ++i) {
    const int width = std::max(first.width >> i, 1), height = std::max(first.height >> i, 1);
    if (levels[i].width != width || levels[i].height != height ||
        levels[i].channels != first.channels) {
      throw Error(ErrorCode::invalid_input,
                  "Level " + std::to_string(i) + " of a mip-mapped OpenEXR image is " +
                      std::to_string(levels[i].width) + " x " + std::to_string(levels[i].height) +
                      " pixels of " + std::to_string(levels[i].channels) + " channels; " +
                      std::to_string(width) + " x " + std::to_string(height) + " of " +
                      std::to_string(first.channels) + " are needed.");
    }
  }
}

}  // namespace

std::vector<std::byte> write_exr(const Image& image, const ExrWriteOptions& options,
                                 ExrPixelType* written) {
  check_image_size(image.width, image.height, "An OpenEXR image");
  const bool half_enough = options.pixel_type == ExrPixelType::half && fits_half(image);
  if (written) *written = half_enough ? ExrPixelType::half : ExrPixelType::float32;
  return with_exr_library(ErrorCode::internal, "The OpenEXR image cannot be written", [&] {
    Imf::Header header = header_for(image, options, half_enough ? Imf::HALF : Imf::FLOAT);
    header.compression() = choose_compression(image, half_enough);
    return write_rows(image, header, half_enough, options.threads);
  });
}

int exr_level_count(int width, int height) {
  int levels = 1;
  for (int side = std::max(width, height); side > 1; side /= 2) ++levels;
  return levels;
}

std::vector<std::byte> write_exr_mipmapped(std::span<const Image> levels,
                                           const ExrWriteOptions& options, ExrPixelType* written) {
  check_levels(levels);
  const bool half_enough = options.pixel_type == ExrPixelType::half &&
                           std::all_of(levels.begin(), levels.end(), fits_half);
  if (written) *written = half_enough ? ExrPixelType::half : ExrPixelType::float32;
  return with_exr_library(ErrorCode::internal, "The OpenEXR image cannot be written", [&] {
    ExrMemoryOutput stream;
    {
      Imf::Header header = header_for(levels[0], options, half_enough ? Imf::HALF : Imf::FLOAT);
      header.compression() = choose_compression(levels[0], half_enough);
      header.setTileDescription(
          Imf::TileDescription(kTileSide, kTileSide, Imf::MIPMAP_LEVELS, Imf::ROUND_DOWN));
      header.insert("lightkiln.levels", Imf::StringAttribute(std::to_string(levels.size())));
      Imf::TiledOutputFile file(stream, header, exr_library_threads(options.threads));
      Image filler;
      for (int level = 0; level < file.numLevels(); ++level) {
        const auto index = static_cast<size_t>(level);
        if (index >= levels.size()) filler = halved(filler.width ? filler : levels.back());
        const Image& image = index < levels.size() ? levels[index] : filler;
        with_buffer(image, half_enough, [&](const Imf::FrameBuffer& buffer) {
          file.setFrameBuffer(buffer);
          file.writeTiles(0, file.numXTiles(level) - 1, 0, file.numYTiles(level) - 1, level);
        });
      }
    }
    return std::move(stream.bytes);
  });
}

}  // namespace lightkiln

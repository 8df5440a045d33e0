// Sources: "OpenEXR File Layout" and "Reading and Writing Image Files with the OpenEXR Library",
// Academy Software Foundation, version 3.1.

#include <algorithm>

#include <ImfFrameBuffer.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfRgbaFile.h>
#include <ImfStringAttribute.h>
#include <ImfTiledInputPart.h>
#include <ImfVersion.h>

#include "core/base/error.h"
#include "core/image/exr.h"
#include "core/image/exr_chunks.h"
#include "core/image/exr_library.h"
#include "core/image/exr_part.h"
#include "core/image/primaries.h"

namespace lightkiln {

namespace {

using Imath::Box2i;

constexpr int kRowsAtOnce = 256;  // the most rows that any compression packs into one block

// Grows `image` row by row inside memory that is reserved but not yet touched, so that a small file
// with a large claim costs what it decodes, not what it claims.
template <typename ReadRows>
Image read_rows(const Box2i& window, int channels, ReadRows&& read) {
  Image image;
  image.width = window.max.x - window.min.x + 1;
  image.height = window.max.y - window.min.y + 1;
  image.channels = channels;
  const size_t row = static_cast<size_t>(image.width) * static_cast<size_t>(channels);
  image.pixels.reserve(row * static_cast<size_t>(image.height));
  for (int y = 0; y < image.height; y += kRowsAtOnce) {
    const int end = std::min(y + kRowsAtOnce, image.height);
    image.pixels.resize(row * static_cast<size_t>(end));
    read(image, window.min.y + y, window.min.y + end - 1);
  }
  return image;
}

std::vector<const char*> channel_names(ExrColors colors) {
  if (colors == ExrColors::rgb) return {"R", "G", "B"};
  return {"Y"};
}

Imf::FrameBuffer buffer_of(Image& image, const std::vector<const char*>& names,
                           const Box2i& window) {
  const size_t pixel = sizeof(float) * names.size();
  const size_t row = pixel * static_cast<size_t>(image.width);
  Imf::FrameBuffer buffer;
  for (size_t c = 0; c < names.size(); ++c) {
    buffer.insert(names[c],
                  Imf::Slice::Make(Imf::FLOAT, image.pixels.data() + c, window, pixel, row));
  }
  return buffer;
}

Image read_channels(Imf::MultiPartInputFile& file, const ExrPart& choice) {
  Imf::InputPart part(file, choice.number);
  const Box2i window = part.header().dataWindow();
  const std::vector<const char*> names = channel_names(choice.colors);
  bool attached = false;
  return read_rows(window, static_cast<int>(names.size()), [&](Image& image, int first, int last) {
    if (!attached) part.setFrameBuffer(buffer_of(image, names, window));
    attached = true;
    part.readPixels(first, last);
  });
}

// The part as a file of its own, its blocks as they are, packed: the library restores chroma in
// files of one part only.
std::vector<std::byte> extract_part(Imf::MultiPartInputFile& file, int number) {
  Imf::InputPart part(file, number);
  Imf::Header header = part.header();
  for (const char* of_parts : {"name", "type", "view", "chunkCount"}) header.erase(of_parts);
  ExrMemoryOutput stream;
  {
    Imf::OutputFile alone(stream, header, 0);
    alone.copyPixels(part);
  }  // the offset table is written when the file closes
  return std::move(stream.bytes);
}

// Luminance/chroma files hold Y at every pixel and RY = (R - Y) / Y, BY = (B - Y) / Y at every
// second one. The library's own reconstruction filter restores them, in 16-bit floats.
Image read_luminance_chroma(std::span<const std::byte> bytes, const Box2i& window) {
  ExrMemoryInput stream(bytes);
  Imf::RgbaInputFile file(stream, 0);
  std::vector<Imf::Rgba> line(static_cast<size_t>(window.max.x - window.min.x + 1));
  // The library adds x to the base it is given; a y stride of 0 puts every row into `line`.
  const auto base = reinterpret_cast<uintptr_t>(line.data()) -
                    static_cast<uintptr_t>(static_cast<intptr_t>(window.min.x)) * sizeof(Imf::Rgba);
  file.setFrameBuffer(reinterpret_cast<Imf::Rgba*>(base), 1, 0);
  return read_rows(window, 3, [&](Image& image, int first, int last) {
    for (int y = first; y <= last; ++y) {
      file.readPixels(y);
      float* out = image.at(0, y - window.min.y);
      for (const Imf::Rgba& pixel : line) {
        *out++ = pixel.r;
        *out++ = pixel.g;
        *out++ = pixel.b;
      }
    }
  });
}

bool has_exr_magic(std::span<const std::byte> bytes) {
  constexpr unsigned char kMagic[4] = {0x76, 0x2f, 0x31, 0x01};
  return bytes.size() >= 8 && std::memcmp(bytes.data(), kMagic, 4) == 0;
}

void check_version(std::span<const std::byte> bytes) {
  if (!has_exr_magic(bytes))
    throw Error(ErrorCode::invalid_input,
                "The file is not an OpenEXR image: its first bytes differ.");
  const auto flags = std::to_integer<unsigned>(bytes[5]);
  constexpr unsigned kDeep = 0x08, kMultiPart = 0x10;
  if ((flags & kDeep) && !(flags & kMultiPart)) {
    throw Error(ErrorCode::unsupported,
                "The OpenEXR image is deep: flatten it to one value per pixel first.");
  }
}

// A file whose headers are read, and the part of it that is to be.
struct OpenFile {
  explicit OpenFile(std::span<const std::byte> bytes)
      : stream((check_version(bytes), bytes)),
        // The table of block offsets is taken as it stands: a file whose table has gaps was never
        // finished, and guessing the missing part would pass black for light.
        file(stream, 0, false),
        part(choose_exr_part(file)) {}

  const Imf::Header& header() const { return file.header(part.number); }

  ExrMemoryInput stream;
  Imf::MultiPartInputFile file;
  ExrPart part;
};

DecodedImage read_checked(std::span<const std::byte> bytes) {
  OpenFile open(bytes);
  const Imf::Header& header = open.header();
  check_exr_chunks(bytes, exr_layout(open.file, open.part.number));
  DecodedImage decoded;
  decoded.envmap = exr_envmap(header);
  decoded.format = exr_format(header, open.part.colors);
  decoded.display = exr_display(header);
  if (open.part.colors == ExrColors::luminance_chroma) {
    const bool alone = !Imf::isMultiPart(open.file.version());
    decoded.image = alone ? read_luminance_chroma(bytes, header.dataWindow())
                          : read_luminance_chroma(extract_part(open.file, open.part.number),
                                                  header.dataWindow());
  } else {
    decoded.image = read_channels(open.file, open.part);
  }
  if (decoded.image.channels == 3) convert_to_rec709(decoded.image, exr_primaries(header));
  return decoded;
}

bool has_mip_levels(const Imf::Header& header) {
  return header.hasTileDescription() && header.tileDescription().mode == Imf::MIPMAP_LEVELS;
}

std::vector<Image> read_mip_levels(std::span<const std::byte> bytes, OpenFile& open) {
  Imf::TiledInputPart part(open.file, open.part.number);
  const std::vector<const char*> names = channel_names(open.part.colors);
  ExrLayout layout = exr_layout(open.file, open.part.number);
  std::vector<Image> levels;
  for (int level = 0; level < part.numLevels(); ++level) {
    const Box2i window = part.dataWindowForLevel(level);
    layout.width = part.levelWidth(level);
    layout.height = part.levelHeight(level);
    check_exr_chunks(bytes, layout);
    const int across = part.numXTiles(level), down = part.numYTiles(level);
    layout.chunks_before += static_cast<uint64_t>(across) * static_cast<uint64_t>(down);
    Image image(layout.width, layout.height, static_cast<int>(names.size()));
    part.setFrameBuffer(buffer_of(image, names, window));
    part.readTiles(0, across - 1, 0, down - 1, level);
    if (image.channels == 3) convert_to_rec709(image, exr_primaries(open.header()));
    levels.push_back(std::move(image));
  }
  return levels;
}

}  // namespace

DecodedImage read_exr(std::span<const std::byte> bytes) {
  return with_exr_library(ErrorCode::invalid_input, "The OpenEXR image is malformed",
                          [&] { return read_checked(bytes); });
}

std::string exr_text(std::span<const std::byte> bytes, const std::string& name) {
  if (!has_exr_magic(bytes)) return {};
  return with_exr_library(ErrorCode::invalid_input, "The OpenEXR image is malformed", [&] {
    const OpenFile open(bytes);
    const auto* text = open.header().findTypedAttribute<Imf::StringAttribute>(name);
    return text != nullptr ? text->value() : std::string();
  });
}

std::vector<Image> read_exr_levels(std::span<const std::byte> bytes) {
  std::vector<Image> levels =
      with_exr_library(ErrorCode::invalid_input, "The OpenEXR image is malformed", [&] {
        OpenFile open(bytes);
        const bool mip =
            has_mip_levels(open.header()) && open.part.colors != ExrColors::luminance_chroma;
        return mip ? read_mip_levels(bytes, open) : std::vector<Image>{};
      });
  if (levels.empty()) levels.push_back(read_exr(bytes).image);
  return levels;
}

}  // namespace lightkiln

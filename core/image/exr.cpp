// Sources: "OpenEXR File Layout" and "Reading and Writing Image Files with the OpenEXR Library",
// Academy Software Foundation, version 3.1.

#include "core/image/exr.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>
#include <optional>

#include <Iex.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfEnvmapAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>
#include <ImfVersion.h>

#include "core/base/error.h"
#include "core/image/exr_chunks.h"
#include "core/image/primaries.h"

namespace lightkiln {

namespace {

using Imath::Box2i;

constexpr float kMaxHalf = 65504.0f;
// Memory that one compressed block may unpack to: 16384 x 256 pixels of 16 bytes fit twice.
constexpr int64_t kMaxBlockBytes = 128 << 20;
constexpr int kRowsAtOnce = 256;  // the most rows that any compression packs into one block

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::span<const std::byte> bytes) : IStream("memory"), bytes_(bytes) {}

  bool read(char target[], int count) override {
    if (count < 0 || position_ > bytes_.size() ||
        static_cast<size_t>(count) > bytes_.size() - position_)
      throw Iex::InputExc("the file ends too early");
    std::memcpy(target, bytes_.data() + position_, static_cast<size_t>(count));
    position_ += static_cast<size_t>(count);
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  std::span<const std::byte> bytes_;
  uint64_t position_ = 0;  // may lie past the end: reading there throws
};

class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : OStream("memory") {}

  void write(const char source[], int count) override {
    const size_t end = position_ + static_cast<size_t>(count);
    if (end > bytes.size()) bytes.resize(end);
    std::memcpy(bytes.data() + position_, source, static_cast<size_t>(count));
    position_ = end;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  std::vector<std::byte> bytes;

 private:
  uint64_t position_ = 0;
};

// The library's limits hold for the whole process and for writing too. They are set far above what
// read_exr allows, so that absurd headers stop before anything is allocated and merely large ones
// reach check_image_size, which says what is allowed.
void prepare_library() {
  static const bool prepared = [] {
    Imf::setGlobalThreadCount(0);
    Imf::Header::setMaxImageSize(1 << 20, 1 << 20);
    Imf::Header::setMaxTileSize(1 << 20, 1 << 20);
    return true;
  }();
  static_cast<void>(prepared);
}

[[noreturn]] void refuse(ErrorCode code, const std::string& sentence) {
  throw Error(code, sentence);
}

// Runs the library and turns what it throws into our one error type.
template <typename F>
auto with_library(ErrorCode code, const std::string& sentence, F&& body) {
  prepare_library();
  try {
    return body();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    refuse(ErrorCode::out_of_memory, "There is not enough memory for the OpenEXR image.");
  } catch (const std::exception& e) {
    // The library begins with the name of the file, which is always the same here.
    const std::string text = e.what(), name = "\"memory\". ";
    const size_t at = text.find(name);
    std::string reason = at == std::string::npos ? text : text.substr(at + name.size());
    while (!reason.empty() && reason.back() == '.') reason.pop_back();
    refuse(code, sentence + ": " + printable(reason) + ".");
  }
}

struct CompressionFacts {
  const char* name;
  int rows;  // in one block of a scan-line file
  ExrPacking packing;
};

CompressionFacts facts_of(Imf::Compression compression) {
  using enum ExrPacking;
  switch (compression) {
    case Imf::NO_COMPRESSION:
      return {"uncompressed", 1, none};
    case Imf::RLE_COMPRESSION:
      return {"RLE", 1, rle};
    case Imf::ZIPS_COMPRESSION:
      return {"ZIPS", 1, zip};
    case Imf::ZIP_COMPRESSION:
      return {"ZIP", 16, zip};
    case Imf::PXR24_COMPRESSION:
      return {"PXR24", 16, self_checked};
    case Imf::PIZ_COMPRESSION:
      return {"PIZ", 32, self_checked};
    case Imf::B44_COMPRESSION:
      return {"B44", 32, self_checked};
    case Imf::B44A_COMPRESSION:
      return {"B44A", 32, self_checked};
    case Imf::DWAA_COMPRESSION:
      return {"DWAA", 32, self_checked};
    case Imf::DWAB_COMPRESSION:
      return {"DWAB", 256, self_checked};
    default:
      break;
  }
  refuse(ErrorCode::unsupported, "The OpenEXR image uses a compression that is not known here.");
}

// What the chosen part holds.
enum class Colors { rgb, luminance, luminance_chroma };

struct Choice {
  int part = 0;
  Colors colors = Colors::rgb;
};

std::optional<Colors> colors_of(const Imf::ChannelList& channels) {
  const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
  if (has("R") && has("G") && has("B")) return Colors::rgb;
  if (has("Y") && has("RY") && has("BY")) return Colors::luminance_chroma;
  if (has("Y")) return Colors::luminance;
  return std::nullopt;
}

std::string names_of(const Imf::ChannelList& channels) {
  std::string names;
  int count = 0;
  for (auto c = channels.begin(); c != channels.end(); ++c, ++count) {
    if (count == 12) return names + ", ...";
    names += (count ? ", " : "") + std::string(c.name());
  }
  return names.empty() ? "none" : names;
}

Choice choose_part(const Imf::MultiPartInputFile& file) {
  bool deep = false;
  for (int n = 0; n < file.parts(); ++n) {
    const Imf::Header& header = file.header(n);
    if (header.hasType() && Imf::isDeepData(header.type())) {
      deep = true;
      continue;
    }
    if (const auto colors = colors_of(header.channels())) return {n, *colors};
  }
  if (deep) {
    refuse(ErrorCode::unsupported,
           "The OpenEXR image is deep: flatten it to one value per pixel first.");
  }
  refuse(ErrorCode::unsupported,
         "The OpenEXR image has no channels named R, G and B, nor Y; its channels are: " +
             printable(names_of(file.header(0).channels())) + ".");
}

void check_sampling(const Imf::ChannelList& channels, Colors colors) {
  for (auto c = channels.begin(); c != channels.end(); ++c) {
    const std::string name = c.name();
    const bool chroma = colors == Colors::luminance_chroma && (name == "RY" || name == "BY");
    const bool color = name == "R" || name == "G" || name == "B" || name == "Y";
    const int allowed = chroma ? 2 : 1;
    const int x = c.channel().xSampling, y = c.channel().ySampling;
    if ((chroma || color) && (x != allowed || y != allowed)) {
      refuse(ErrorCode::unsupported, "The OpenEXR channel " + name + " has a sampling of " +
                                         std::to_string(x) + " x " + std::to_string(y) +
                                         " pixels: 1 x 1 is read for R, G, B and Y, 2 x 2 for RY "
                                         "and BY.");
    }
  }
}

// The layout of part n, once everything is checked that decides how much memory the decoder takes.
ExrLayout layout_of(const Imf::MultiPartInputFile& file, int n) {
  const Imf::Header& header = file.header(n);
  const Box2i& window = header.dataWindow();
  const int64_t width = int64_t{window.max.x} - window.min.x + 1;
  const int64_t height = int64_t{window.max.y} - window.min.y + 1;
  check_image_size(width, height, "An OpenEXR image");

  ExrLayout layout;
  layout.multi_part = Imf::isMultiPart(file.version());
  for (int before = 0; before < n; ++before)
    layout.chunks_before += static_cast<uint64_t>(std::max(file.header(before).chunkCount(), 0));
  layout.min_x = window.min.x;
  layout.min_y = window.min.y;
  layout.width = static_cast<int>(width);
  layout.height = static_cast<int>(height);
  layout.tiled = header.hasTileDescription();
  layout.packing = facts_of(header.compression()).packing;
  layout.block_width = layout.width;
  layout.block_height = facts_of(header.compression()).rows;
  if (layout.tiled) {
    layout.block_width = static_cast<int>(header.tileDescription().xSize);
    layout.block_height = static_cast<int>(header.tileDescription().ySize);
  }
  int64_t pixel_bytes = 0;
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    const Imf::Channel& channel = c.channel();
    const int bytes = channel.type == Imf::HALF ? 2 : 4;
    layout.channels.push_back({bytes, channel.xSampling, channel.ySampling});
    pixel_bytes += bytes;
  }
  const int64_t block_pixels = int64_t{layout.block_width} * layout.block_height;
  if (block_pixels > kMaxBlockBytes / pixel_bytes) {
    refuse(ErrorCode::too_large,
           "One block of the OpenEXR image, " + std::to_string(layout.block_width) + " x " +
               std::to_string(layout.block_height) + " pixels of " + std::to_string(pixel_bytes) +
               " bytes, is too large: at most " + std::to_string(kMaxBlockBytes) +
               " bytes are allowed. Use fewer channels or smaller tiles.");
  }
  return layout;
}

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

Image read_channels(Imf::MultiPartInputFile& file, const Choice& choice) {
  Imf::InputPart part(file, choice.part);
  const Box2i window = part.header().dataWindow();
  const std::vector<const char*> names = choice.colors == Colors::rgb
                                             ? std::vector<const char*>{"R", "G", "B"}
                                             : std::vector<const char*>{"Y"};
  bool attached = false;
  return read_rows(window, static_cast<int>(names.size()), [&](Image& image, int first, int last) {
    if (!attached) {
      const size_t pixel = sizeof(float) * names.size();
      const size_t row = pixel * static_cast<size_t>(image.width);
      Imf::FrameBuffer buffer;
      for (size_t c = 0; c < names.size(); ++c) {
        buffer.insert(names[c],
                      Imf::Slice::Make(Imf::FLOAT, image.pixels.data() + c, window, pixel, row));
      }
      part.setFrameBuffer(buffer);
      attached = true;
    }
    part.readPixels(first, last);
  });
}

// Luminance/chroma files hold Y at every pixel and RY = (R - Y) / Y, BY = (B - Y) / Y at every
// second one. The library's own reconstruction filter restores them, in 16-bit floats.
Image read_luminance_chroma(std::span<const std::byte> bytes, const Box2i& window) {
  MemoryInput stream(bytes);
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

Primaries primaries_of(const Imf::Header& header) {
  Primaries primaries;
  if (Imf::hasChromaticities(header)) {
    const Imf::Chromaticities& stated = Imf::chromaticities(header);
    primaries.red = {stated.red.x, stated.red.y};
    primaries.green = {stated.green.x, stated.green.y};
    primaries.blue = {stated.blue.x, stated.blue.y};
    primaries.white = {stated.white.x, stated.white.y};
  }
  return primaries;
}

EnvmapAttribute envmap_of(const Imf::Header& header) {
  if (!Imf::hasEnvmap(header)) return EnvmapAttribute::none;
  switch (Imf::envmap(header)) {
    case Imf::ENVMAP_LATLONG:
      return EnvmapAttribute::latlong;
    case Imf::ENVMAP_CUBE:
      return EnvmapAttribute::cube;
    default:
      break;
  }
  refuse(ErrorCode::invalid_input,
         "The OpenEXR attribute envmap holds a layout that is neither lat-long nor cube.");
}

std::string format_of(const Imf::Header& header, Colors colors) {
  const Imf::Channel* first = header.channels().findChannel(colors == Colors::rgb ? "R" : "Y");
  std::string format = "OpenEXR, ";
  format += first->type == Imf::HALF    ? "16-bit float"
            : first->type == Imf::FLOAT ? "32-bit float"
                                        : "32-bit integer";
  format += std::string(", ") + facts_of(header.compression()).name;
  if (header.hasTileDescription()) format += ", tiled";
  if (colors == Colors::luminance_chroma) format += ", luminance/chroma";
  return format;
}

void check_version(std::span<const std::byte> bytes) {
  constexpr unsigned char kMagic[4] = {0x76, 0x2f, 0x31, 0x01};
  if (bytes.size() < 8 || std::memcmp(bytes.data(), kMagic, 4) != 0)
    refuse(ErrorCode::invalid_input, "The file is not an OpenEXR image: its first bytes differ.");
  const auto flags = std::to_integer<unsigned>(bytes[5]);
  constexpr unsigned kDeep = 0x08, kMultiPart = 0x10;
  if ((flags & kDeep) && !(flags & kMultiPart)) {
    refuse(ErrorCode::unsupported,
           "The OpenEXR image is deep: flatten it to one value per pixel first.");
  }
}

DecodedImage read_checked(std::span<const std::byte> bytes) {
  check_version(bytes);
  MemoryInput stream(bytes);
  // The table of block offsets is taken as it stands: a file whose table has gaps was never
  // finished, and guessing the missing part would pass black for light.
  Imf::MultiPartInputFile file(stream, 0, false);
  const Choice choice = choose_part(file);
  const Imf::Header& header = file.header(choice.part);
  check_sampling(header.channels(), choice.colors);
  check_exr_chunks(bytes, layout_of(file, choice.part));
  DecodedImage decoded;
  decoded.envmap = envmap_of(header);
  decoded.format = format_of(header, choice.colors);
  if (choice.colors == Colors::luminance_chroma) {
    if (file.parts() > 1) {
      refuse(ErrorCode::unsupported,
             "The OpenEXR image is a multi-part file with luminance/chroma channels: store R, G "
             "and B instead.");
    }
    decoded.image = read_luminance_chroma(bytes, header.dataWindow());
  } else {
    decoded.image = read_channels(file, choice);
  }
  if (decoded.image.channels == 3) convert_to_rec709(decoded.image, primaries_of(header));
  return decoded;
}

bool fits_half(const Image& image) {
  return std::none_of(image.pixels.begin(), image.pixels.end(), [](float value) {
    return std::isfinite(value) && std::abs(value) > kMaxHalf;
  });
}

Imf::Header header_for(const Image& image, const ExrWriteOptions& options, Imf::PixelType type) {
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  header.zipCompressionLevel() = 6;
  Imf::addChromaticities(header, Imf::Chromaticities());  // the defaults are Rec. 709
  if (options.envmap != EnvmapAttribute::none) {
    Imf::addEnvmap(
        header, options.envmap == EnvmapAttribute::cube ? Imf::ENVMAP_CUBE : Imf::ENVMAP_LATLONG);
  }
  for (const auto& [name, text] : options.attributes)
    header.insert(name, Imf::StringAttribute(text));
  for (int c = 0; c < image.channels; ++c) {
    const char* name = image.channels == 1 ? "Y" : &"R\0G\0B\0A"[2 * c];
    header.channels().insert(name, Imf::Channel(type));
  }
  return header;
}

template <typename T>
std::vector<std::byte> write_pixels(const Image& image, const Imf::Header& header, const T* pixels,
                                    Imf::PixelType type) {
  MemoryOutput stream;
  {
    Imf::OutputFile file(stream, header, 0);
    const size_t pixel = sizeof(T) * static_cast<size_t>(image.channels);
    Imf::FrameBuffer buffer;
    for (int c = 0; c < image.channels; ++c) {
      const char* name = image.channels == 1 ? "Y" : &"R\0G\0B\0A"[2 * c];
      buffer.insert(name, Imf::Slice::Make(type, pixels + c, header.dataWindow(), pixel,
                                           pixel * static_cast<size_t>(image.width)));
    }
    file.setFrameBuffer(buffer);
    file.writePixels(image.height);
  }  // the offset table is written when the file closes
  return std::move(stream.bytes);
}

}  // namespace

DecodedImage read_exr(std::span<const std::byte> bytes) {
  return with_library(ErrorCode::invalid_input, "The OpenEXR image is malformed",
                      [&] { return read_checked(bytes); });
}

std::vector<std::byte> write_exr(const Image& image, const ExrWriteOptions& options,
                                 ExrPixelType* written) {
  check_image_size(image.width, image.height, "An OpenEXR image");
  const bool half_enough = options.pixel_type == ExrPixelType::half && fits_half(image);
  if (written) *written = half_enough ? ExrPixelType::half : ExrPixelType::float32;
  return with_library(ErrorCode::internal, "The OpenEXR image cannot be written", [&] {
    if (!half_enough) {
      return write_pixels(image, header_for(image, options, Imf::FLOAT), image.pixels.data(),
                          Imf::FLOAT);
    }
    const std::vector<half> rounded(image.pixels.begin(), image.pixels.end());
    return write_pixels(image, header_for(image, options, Imf::HALF), rounded.data(), Imf::HALF);
  });
}

}  // namespace lightkiln

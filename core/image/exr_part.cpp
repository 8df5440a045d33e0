#include "core/image/exr_part.h"

#include <algorithm>
#include <optional>

#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfEnvmapAttribute.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfVersion.h>

#include "core/base/error.h"

namespace lightkiln {

namespace {

using Imath::Box2i;

// Memory that one compressed block may unpack to: 16384 x 256 pixels of 16 bytes fit twice.
constexpr int64_t kMaxBlockBytes = 128 << 20;

[[noreturn]] void refuse(ErrorCode code, const std::string& sentence) {
  throw Error(code, sentence);
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

std::optional<ExrColors> colors_of(const Imf::ChannelList& channels) {
  const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
  if (has("R") && has("G") && has("B")) return ExrColors::rgb;
  if (has("Y") && has("RY") && has("BY")) return ExrColors::luminance_chroma;
  if (has("Y")) return ExrColors::luminance;
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

void check_sampling(const Imf::ChannelList& channels, ExrColors colors) {
  for (auto c = channels.begin(); c != channels.end(); ++c) {
    const std::string name = c.name();
    const bool chroma = colors == ExrColors::luminance_chroma && (name == "RY" || name == "BY");
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

}  // namespace

ExrPart choose_exr_part(const Imf::MultiPartInputFile& file) {
  bool deep = false;
  for (int n = 0; n < file.parts(); ++n) {
    const Imf::Header& header = file.header(n);
    if (header.hasType() && Imf::isDeepData(header.type())) {
      deep = true;
      continue;
    }
    if (const auto colors = colors_of(header.channels())) {
      check_sampling(header.channels(), *colors);
      return {n, *colors};
    }
  }
  if (deep) {
    refuse(ErrorCode::unsupported,
           "The OpenEXR image is deep: flatten it to one value per pixel first.");
  }
  refuse(ErrorCode::unsupported,
         "The OpenEXR image has no channels named R, G and B, nor Y; its channels are: " +
             printable(names_of(file.header(0).channels())) + ".");
}

ExrLayout exr_layout(const Imf::MultiPartInputFile& file, int n) {
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

Primaries exr_primaries(const Imf::Header& header) {
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

EnvmapAttribute exr_envmap(const Imf::Header& header) {
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

std::optional<PixelWindow> exr_display(const Imf::Header& header) {
  const Box2i& data = header.dataWindow();
  const Box2i& display = header.displayWindow();
  if (data == display) return std::nullopt;
  return PixelWindow{int64_t{display.min.x} - data.min.x, int64_t{display.min.y} - data.min.y,
                     int64_t{display.max.x} - display.min.x + 1,
                     int64_t{display.max.y} - display.min.y + 1};
}

std::string exr_format(const Imf::Header& header, ExrColors colors) {
  const Imf::Channel* first = header.channels().findChannel(colors == ExrColors::rgb ? "R" : "Y");
  std::string format = "OpenEXR, ";
  format += first->type == Imf::HALF    ? "16-bit float"
            : first->type == Imf::FLOAT ? "32-bit float"
                                        : "32-bit integer";
  format += std::string(", ") + facts_of(header.compression()).name;
  if (header.hasTileDescription()) format += ", tiled";
  if (colors == ExrColors::luminance_chroma) format += ", luminance/chroma";
  return format;
}

}  // namespace lightkiln

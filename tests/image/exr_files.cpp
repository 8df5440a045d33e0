#include "tests/image/exr_files.h"

#include <cstring>
#include <map>
#include <stdexcept>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <ImfStandardAttributes.h>
#include <ImfStdIO.h>
#include <ImfTiledOutputFile.h>

namespace lightkiln::test {

namespace {

Imf::Compression compression_named(const std::string& name) {
  static const std::map<std::string, Imf::Compression> known = {
      {"none", Imf::NO_COMPRESSION},   {"rle", Imf::RLE_COMPRESSION},
      {"zips", Imf::ZIPS_COMPRESSION}, {"zip", Imf::ZIP_COMPRESSION},
      {"piz", Imf::PIZ_COMPRESSION},   {"pxr24", Imf::PXR24_COMPRESSION},
      {"b44", Imf::B44_COMPRESSION},   {"b44a", Imf::B44A_COMPRESSION},
      {"dwaa", Imf::DWAA_COMPRESSION}, {"dwab", Imf::DWAB_COMPRESSION}};
  return known.at(name);
}

Imf::PixelType type_of(ExrSamples samples) {
  return samples == ExrSamples::half      ? Imf::HALF
         : samples == ExrSamples::float32 ? Imf::FLOAT
                                          : Imf::UINT;
}

size_t size_of(ExrSamples samples) {
  return samples == ExrSamples::half ? 2 : 4;
}

// One channel of a level in the sample type of the file, with its slice.
struct Plane {
  std::string name;
  std::vector<std::byte> bytes;
};

void put(std::byte* at, float value, ExrSamples samples) {
  const half as_half = value;
  const auto as_uint = static_cast<uint32_t>(value);
  if (samples == ExrSamples::half) std::memcpy(at, &as_half, 2);
  if (samples == ExrSamples::float32) std::memcpy(at, &value, 4);
  if (samples == ExrSamples::uint32) std::memcpy(at, &as_uint, 4);
}

template <typename Value>
Plane make_plane(const std::string& name, size_t count, ExrSamples samples, Value&& value) {
  Plane plane{name, std::vector<std::byte>(count * size_of(samples))};
  for (size_t i = 0; i < count; ++i)
    put(plane.bytes.data() + i * size_of(samples), value(i), samples);
  return plane;
}

std::vector<Plane> planes_of(const Image& image, const ExrRecipe& recipe) {
  const auto channels = static_cast<size_t>(image.channels);
  const size_t count = image.pixels.size() / channels;
  std::vector<Plane> planes;
  for (size_t c = 0; c < channels; ++c) {
    const std::string name = channels == 1 ? "Y" : std::string(1, "RGBA"[c]);
    planes.push_back(make_plane(name, count, recipe.samples,
                                [&](size_t i) { return image.pixels[i * channels + c]; }));
  }
  for (const std::string& name : recipe.extra_channels)
    planes.push_back(make_plane(name, count, recipe.samples, [](size_t) { return 7.0f; }));
  return planes;
}

Imf::FrameBuffer buffer_of(const std::vector<Plane>& planes, const Imf::Header& header,
                           ExrSamples samples) {
  const auto& window = header.dataWindow();
  const auto width = static_cast<size_t>(window.max.x - window.min.x + 1);
  Imf::FrameBuffer buffer;
  for (const Plane& plane : planes) {
    buffer.insert(plane.name, Imf::Slice::Make(type_of(samples), plane.bytes.data(), window,
                                               size_of(samples), size_of(samples) * width));
  }
  return buffer;
}

Imf::Header header_of(const Image& image, const ExrRecipe& recipe) {
  const Imath::Box2i window(
      {recipe.window_x, recipe.window_y},
      {recipe.window_x + image.width - 1, recipe.window_y + image.height - 1});
  Imath::Box2i display = window;
  if (recipe.display) {
    display.min = window.min + Imath::V2i(static_cast<int>(recipe.display->x),
                                          static_cast<int>(recipe.display->y));
    display.max = display.min + Imath::V2i(static_cast<int>(recipe.display->width) - 1,
                                           static_cast<int>(recipe.display->height) - 1);
  }
  Imf::Header header(display, window);
  if (recipe.envmap_latlong) Imf::addEnvmap(header, Imf::ENVMAP_LATLONG);
  header.compression() = compression_named(recipe.compression);
  if (recipe.decreasing_lines) header.lineOrder() = Imf::DECREASING_Y;
  if (recipe.primaries) {
    const auto point = [](const Chromaticity& c) {
      return Imath::V2f(static_cast<float>(c.x), static_cast<float>(c.y));
    };
    const Primaries& p = *recipe.primaries;
    Imf::addChromaticities(
        header, Imf::Chromaticities(point(p.red), point(p.green), point(p.blue), point(p.white)));
  }
  for (const Plane& plane : planes_of(Image(1, 1, image.channels), recipe))
    header.channels().insert(plane.name, Imf::Channel(type_of(recipe.samples)));
  return header;
}

void write_tiles(Imf::OStream& stream, Imf::Header header, const Image& image,
                 const ExrRecipe& recipe) {
  const Imf::LevelMode mode = recipe.storage == ExrStorage::tiles     ? Imf::ONE_LEVEL
                              : recipe.storage == ExrStorage::mip_map ? Imf::MIPMAP_LEVELS
                                                                      : Imf::RIPMAP_LEVELS;
  header.setTileDescription(Imf::TileDescription(16, 8, mode));
  Imf::TiledOutputFile file(stream, header, 0);
  std::vector<Plane> planes = planes_of(image, recipe);
  for (int ly = 0; ly < file.numYLevels(); ++ly) {
    for (int lx = 0; lx < file.numXLevels(); ++lx) {
      if (mode == Imf::MIPMAP_LEVELS && lx != ly) continue;
      // Smaller levels use the first rows and columns of planes of the full size.
      file.setFrameBuffer(buffer_of(planes, header, recipe.samples));
      file.writeTiles(0, file.numXTiles(lx) - 1, 0, file.numYTiles(ly) - 1, lx, ly);
      for (Plane& plane : planes) {
        plane = make_plane(plane.name, plane.bytes.size() / size_of(recipe.samples), recipe.samples,
                           [](size_t) { return 999.0f; });
      }
    }
  }
}

void write_two_parts(Imf::OStream& stream, Imf::Header header, const Image& image,
                     const ExrRecipe& recipe) {
  Imf::Header depth = header;
  depth.channels() = Imf::ChannelList();
  depth.channels().insert("Z", Imf::Channel(type_of(recipe.samples)));
  depth.setName("depth");
  header.setName("color");
  depth.setType(Imf::SCANLINEIMAGE);
  header.setType(Imf::SCANLINEIMAGE);
  const Imf::Header headers[2] = {depth, header};
  Imf::MultiPartOutputFile file(stream, headers, 2, false, 0);
  const size_t count = image.pixels.size() / static_cast<size_t>(image.channels);
  const std::vector<Plane> z = {
      make_plane("Z", count, recipe.samples, [](size_t) { return 999.0f; })};
  Imf::OutputPart first(file, 0), second(file, 1);
  first.setFrameBuffer(buffer_of(z, depth, recipe.samples));
  first.writePixels(image.height);
  const std::vector<Plane> planes = planes_of(image, recipe);
  second.setFrameBuffer(buffer_of(planes, header, recipe.samples));
  second.writePixels(image.height);
}

std::vector<std::byte> bytes_of(const Imf::StdOSStream& stream) {
  const std::string text = stream.str();
  std::vector<std::byte> bytes(text.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

}  // namespace

std::vector<std::byte> make_exr(const Image& image, const ExrRecipe& recipe) {
  Imf::StdOSStream stream;
  const Imf::Header header = header_of(image, recipe);
  if (recipe.storage != ExrStorage::scan_lines) {
    write_tiles(stream, header, image, recipe);
  } else if (recipe.second_part) {
    write_two_parts(stream, header, image, recipe);
  } else {
    Imf::OutputFile file(stream, header, 0);
    const std::vector<Plane> planes = planes_of(image, recipe);
    file.setFrameBuffer(buffer_of(planes, header, recipe.samples));
    file.writePixels(image.height);
  }
  return bytes_of(stream);
}

std::vector<std::byte> make_luminance_chroma_exr(const Image& image, const ChromaRecipe& recipe) {
  Imf::StdOSStream stream;
  ExrRecipe colors;
  colors.compression = recipe.compression;
  colors.window_x = recipe.window_x;
  colors.window_y = recipe.window_y;
  Imf::Header header = header_of(image, colors);
  header.channels() = Imf::ChannelList();
  {
    Imf::RgbaOutputFile file(stream, header, Imf::WRITE_YC, 0);
    file.setYCRounding(10, 10);  // all bits of a half, instead of 7 and 5
    std::vector<Imf::Rgba> pixels;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const Vec3 rgb = image.rgb(x, y);
        pixels.emplace_back(rgb.x, rgb.y, rgb.z);
      }
    }
    const std::ptrdiff_t corner =
        recipe.window_x + std::ptrdiff_t{recipe.window_y} * std::ptrdiff_t{image.width};
    file.setFrameBuffer(pixels.data() - corner, 1, static_cast<size_t>(image.width));
    file.writePixels(image.height);
  }
  if (!recipe.second_part) return bytes_of(stream);

  Imf::StdISStream alone;
  alone.str(stream.str());
  Imf::MultiPartInputFile single(alone, 0);
  Imf::InputPart source(single, 0);
  Imf::Header color = source.header();
  color.setName("color");
  color.setType(Imf::SCANLINEIMAGE);
  Imf::Header depth(2 * image.width, 2 * image.height + 1);
  depth.compression() = header.compression();
  depth.channels().insert("Z", Imf::Channel(Imf::HALF));
  depth.setName("depth");
  depth.setType(Imf::SCANLINEIMAGE);
  const Imf::Header headers[2] = {depth, color};
  Imf::StdOSStream both;
  {
    Imf::MultiPartOutputFile file(both, headers, 2, true, 0);
    const std::vector<Plane> z = {make_plane(
        "Z", static_cast<size_t>(2 * image.width) * static_cast<size_t>(2 * image.height + 1),
        ExrSamples::half, [](size_t) { return 999.0f; })};
    Imf::OutputPart first(file, 0), second(file, 1);
    first.setFrameBuffer(buffer_of(z, depth, ExrSamples::half));
    first.writePixels(2 * image.height + 1);
    second.copyPixels(source);
  }
  return bytes_of(both);
}

Image ramp(int width, int height, int channels) {
  Image image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        image.at(x, y)[c] =
            0.25f + 2.0f * static_cast<float>(x) / static_cast<float>(width) +
            static_cast<float>(c + 1) * static_cast<float>(y) / static_cast<float>(height);
      }
    }
  }
  return image;
}

}  // namespace lightkiln::test

// Sources: Ward, "Real Pixels", Graphics Gems II, 1991 (the RGBE format); "Radiance file formats",
// Lawrence Berkeley National Laboratory (header, resolution string, run-length encodings).

#include "core/image/radiance_hdr.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/image/primaries.h"

namespace lightkiln {

namespace {

using Rgbe = std::array<uint8_t, 4>;

// New run-length encoding exists for scan lines of these lengths only.
constexpr int kShortestRun = 8;
constexpr int kLongestRun = 32767;

[[noreturn]] void malformed(const std::string& what) {
  throw Error(ErrorCode::invalid_input, "The Radiance HDR image is malformed: " + what + ".");
}

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  size_t left() const { return bytes_.size() - position_; }

  uint8_t byte() {
    if (left() == 0) malformed("it ends too early");
    return std::to_integer<uint8_t>(bytes_[position_++]);
  }
  Rgbe pixel() {
    if (left() < 4) malformed("it ends too early");
    Rgbe value;
    for (uint8_t& channel : value) channel = byte();
    return value;
  }
  Rgbe peek() const {
    if (left() < 4) malformed("it ends too early");
    Rgbe value;
    for (size_t i = 0; i < 4; ++i) value[i] = std::to_integer<uint8_t>(bytes_[position_ + i]);
    return value;
  }
  std::string line() {
    const auto rest = bytes_.subspan(position_);
    const auto end = std::find(rest.begin(), rest.end(), std::byte{'\n'});
    if (end == rest.end()) malformed("its header does not end");
    std::string text(reinterpret_cast<const char*>(rest.data()),
                     static_cast<size_t>(end - rest.begin()));
    position_ += text.size() + 1;
    if (!text.empty() && text.back() == '\r') text.pop_back();
    return text;
  }

 private:
  std::span<const std::byte> bytes_;
  size_t position_ = 0;
};

struct Header {
  double exposure[3] = {1, 1, 1};  // what radiance was multiplied by, per channel
  Primaries primaries;
  // Scan lines run along x (rows) or along y (columns), each axis in either direction.
  int width = 0, height = 0;
  bool columns = false, flip_x = false, flip_y = false;
};

std::vector<double> numbers(const std::string& text) {
  std::vector<double> values;
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  for (double value; in >> value;) values.push_back(value);
  return values;
}

// EXPOSURE (one factor) and COLORCORR (three) each accumulate over the lines of the header.
void multiply_exposure(Header& header, const std::string& text, size_t count) {
  const std::vector<double> values = numbers(text);
  if (values.size() != count) malformed("it has an exposure of \"" + printable(text) + "\"");
  for (size_t c = 0; c < 3; ++c) {
    header.exposure[c] *= values[count == 1 ? 0 : c];
    if (!(header.exposure[c] > 1e-30 && header.exposure[c] < 1e30))
      malformed("it has an exposure of \"" + printable(text) +
                "\"; their product must lie between 1e-30 and 1e30");
  }
}

// Eight numbers: x and y of red, green, blue and white. Some programs write eight zeros for
// "unknown"; those mean nothing.
void set_primaries(Header& header, const std::string& text) {
  const std::vector<double> v = numbers(text);
  if (std::all_of(v.begin(), v.end(), [](double value) { return value == 0; })) return;
  if (v.size() != 8)
    malformed("it has primaries of \"" + printable(text) + "\"; eight numbers are needed");
  header.primaries = {{v[0], v[1]}, {v[2], v[3]}, {v[4], v[5]}, {v[6], v[7]}};
}

struct Axis {
  char sign = 0, name = 0;
  int length = 0;
};

bool parse_axis(std::istringstream& in, Axis& axis) {
  std::string direction;
  if (!(in >> direction >> axis.length) || direction.size() != 2) return false;
  axis.sign = direction[0];
  axis.name = direction[1];
  return (axis.sign == '+' || axis.sign == '-') && (axis.name == 'X' || axis.name == 'Y');
}

// "-Y 512 +X 1024": first the axis from scan line to scan line, then the one along a scan line. Y
// grows upwards and X to the right, so "-Y" starts at the top and "+X" at the left.
void parse_resolution(Header& header, const std::string& text) {
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  Axis slow, fast;
  if (!parse_axis(in, slow) || !parse_axis(in, fast) || slow.name == fast.name)
    malformed("it has a resolution of \"" + printable(text) + "\"");
  header.columns = slow.name == 'X';
  const Axis& x = header.columns ? slow : fast;
  const Axis& y = header.columns ? fast : slow;
  header.width = x.length;
  header.height = y.length;
  header.flip_x = x.sign == '-';
  header.flip_y = y.sign == '+';
}

Header read_header(Reader& reader) {
  if (reader.line().rfind("#?", 0) != 0)
    malformed("its first line does not begin with the signature #?");
  Header header;
  for (std::string text = reader.line(); !text.empty(); text = reader.line()) {
    const size_t equals = text.find('=');
    if (text[0] == '#' || equals == std::string::npos) continue;
    const std::string key = text.substr(0, equals), value = text.substr(equals + 1);
    if (key == "FORMAT" && value.find("32-bit_rle_rgbe") == std::string::npos) {
      throw Error(ErrorCode::unsupported, "The Radiance HDR image has the format \"" +
                                              printable(value) +
                                              "\": only 32-bit_rle_rgbe is read.");
    }
    if (key == "EXPOSURE") multiply_exposure(header, value, 1);
    if (key == "COLORCORR") multiply_exposure(header, value, 3);
    if (key == "PRIMARIES") set_primaries(header, value);
  }
  parse_resolution(header, reader.line());
  return header;
}

// Four channels one after the other, each as runs: a count above 128 repeats the next byte count -
// 128 times, a count from 1 to 128 copies that many bytes.
void read_new_runs(Reader& reader, std::span<Rgbe> line) {
  for (size_t channel = 0; channel < 4; ++channel) {
    for (size_t x = 0; x < line.size();) {
      const uint8_t code = reader.byte();
      const size_t count = code > 128 ? code - 128u : code;
      if (count == 0) malformed("it holds a run of no pixels");
      if (count > line.size() - x) malformed("it holds a run past the end of its scan line");
      if (code > 128) {
        const uint8_t value = reader.byte();
        for (size_t i = 0; i < count; ++i) line[x++][channel] = value;
      } else {
        for (size_t i = 0; i < count; ++i) line[x++][channel] = reader.byte();
      }
    }
  }
}

// Pixels one after the other; (1, 1, 1, n) repeats the pixel before n times, and each such pixel
// that follows directly counts for 256 times as many.
void read_flat_or_old_runs(Reader& reader, std::span<Rgbe> line) {
  int shift = 0;
  for (size_t x = 0; x < line.size();) {
    const Rgbe value = reader.pixel();
    if (value[0] != 1 || value[1] != 1 || value[2] != 1) {
      line[x++] = value;
      shift = 0;
      continue;
    }
    if (x == 0) malformed("it holds a scan line that begins with a repetition");
    if (shift > 16) malformed("it holds a run past the end of its scan line");
    const size_t count = static_cast<size_t>(value[3]) << shift;
    if (count > line.size() - x) malformed("it holds a run past the end of its scan line");
    std::fill_n(line.begin() + static_cast<std::ptrdiff_t>(x), count, line[x - 1]);
    x += count;
    shift += 8;
  }
}

void read_scan_line(Reader& reader, std::span<Rgbe> line) {
  const int length = static_cast<int>(line.size());
  if (length >= kShortestRun && length <= kLongestRun) {
    const Rgbe mark = reader.peek();
    if (mark[0] == 2 && mark[1] == 2 && mark[2] < 128) {
      if (mark[2] * 256 + mark[3] != length)
        malformed("it holds a scan line of another length than the image");
      reader.pixel();
      return read_new_runs(reader, line);
    }
  }
  read_flat_or_old_runs(reader, line);
}

// A channel is mantissa * 2^(exponent - 136); exponent 0 is black.
void decode(const Rgbe& rgbe, const double exposure[3], float* rgb) {
  if (rgbe[3] == 0) {
    rgb[0] = rgb[1] = rgb[2] = 0;
    return;
  }
  const double scale = std::ldexp(1.0, rgbe[3] - 136);
  for (size_t c = 0; c < 3; ++c) rgb[c] = static_cast<float>(rgbe[c] * scale / exposure[c]);
}

// Puts scan lines, decoded in file order, where the resolution string says that they belong.
Image orient(const Header& header, const std::vector<float>& lines) {
  Image image(header.width, header.height, 3);
  const int length = header.columns ? header.height : header.width;
  for (int y = 0; y < header.height; ++y) {
    for (int x = 0; x < header.width; ++x) {
      const int file_x = header.flip_x ? header.width - 1 - x : x;
      const int file_y = header.flip_y ? header.height - 1 - y : y;
      const int line = header.columns ? file_x : file_y, place = header.columns ? file_y : file_x;
      const size_t from =
          (static_cast<size_t>(line) * static_cast<size_t>(length) + static_cast<size_t>(place)) *
          3;
      std::copy_n(lines.begin() + static_cast<std::ptrdiff_t>(from), 3, image.at(x, y));
    }
  }
  return image;
}

// With largest in [2^(e-1), 2^e) one step of a mantissa is 2^(e-8). Rounded to nearest, a channel
// errs by half a step: at most 2^(e-9) <= 2^-8 largest.
Rgbe encode(const float* rgb) {
  const float largest = std::max({rgb[0], rgb[1], rgb[2]});
  if (largest == 0) return {0, 0, 0, 0};
  int exponent = 0;
  std::frexp(largest, &exponent);  // largest = f * 2^exponent, f in [0.5, 1)
  if (std::lround(std::ldexp(static_cast<double>(largest), 8 - exponent)) > 255) ++exponent;
  if (exponent < -127) return {0, 0, 0, 0};  // below 2^-128 nothing can be held
  Rgbe rgbe{};
  for (size_t c = 0; c < 3; ++c)
    rgbe[c] =
        static_cast<uint8_t>(std::lround(std::ldexp(static_cast<double>(rgb[c]), 8 - exponent)));
  rgbe[3] = static_cast<uint8_t>(exponent + 128);
  return rgbe;
}

void append(std::vector<std::byte>& bytes, std::string_view text) {
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
}

// One channel of one scan line. A run pays from three equal bytes on.
void append_runs(std::vector<std::byte>& bytes, std::span<const uint8_t> values) {
  const auto run_at = [&](size_t x) {
    size_t end = x + 1;
    while (end < values.size() && end - x < 127 && values[end] == values[x]) ++end;
    return end - x;
  };
  for (size_t x = 0; x < values.size();) {
    const size_t run = run_at(x);
    if (run >= 3) {
      bytes.push_back(static_cast<std::byte>(128 + run));
      bytes.push_back(static_cast<std::byte>(values[x]));
      x += run;
      continue;
    }
    size_t end = x + 1;
    while (end < values.size() && end - x < 128 && run_at(end) < 3) ++end;
    bytes.push_back(static_cast<std::byte>(end - x));
    for (; x < end; ++x) bytes.push_back(static_cast<std::byte>(values[x]));
  }
}

}  // namespace

DecodedImage read_radiance_hdr(std::span<const std::byte> bytes) {
  Reader reader(bytes);
  const Header header = read_header(reader);
  check_image_size(header.width, header.height, "A Radiance HDR image");
  const auto length = static_cast<size_t>(header.columns ? header.height : header.width);
  const auto count = static_cast<size_t>(header.columns ? header.width : header.height);
  // Whatever the encoding, a scan line takes four bytes; beyond that, memory grows only as lines
  // are decoded.
  if (reader.left() / 4 < count) malformed("it ends too early");
  std::vector<float> lines;
  lines.reserve(length * count * 3);
  std::vector<Rgbe> line(length);
  for (size_t i = 0; i < count; ++i) {
    read_scan_line(reader, line);
    lines.resize((i + 1) * length * 3);
    for (size_t x = 0; x < length; ++x)
      decode(line[x], header.exposure, lines.data() + (i * length + x) * 3);
  }

  DecodedImage decoded;
  decoded.format = "Radiance HDR, 32-bit RGBE";
  if (header.columns || header.flip_x || header.flip_y) {
    decoded.image = orient(header, lines);
  } else {
    decoded.image.width = header.width;
    decoded.image.height = header.height;
    decoded.image.channels = 3;
    decoded.image.pixels = std::move(lines);
  }
  convert_to_rec709(decoded.image, header.primaries);
  return decoded;
}

std::vector<std::byte> write_radiance_hdr(const Image& image) {
  check_image_size(image.width, image.height, "A Radiance HDR image");
  std::vector<std::byte> bytes;
  append(bytes, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(image.height) +
                    " +X " + std::to_string(image.width) + "\n");
  const bool runs = image.width >= kShortestRun && image.width <= kLongestRun;
  const auto width = static_cast<size_t>(image.width);
  std::vector<uint8_t> channels(4 * width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const Vec3 rgb = image.rgb(x, y);
      const float values[3] = {rgb.x, rgb.y, rgb.z};
      for (const float value : values) {
        if (!(value >= 0 && value < 0x1p126f)) {
          throw Error(ErrorCode::invalid_input, "A Radiance HDR image cannot hold " +
                                                    std::to_string(value) + " at pixel " +
                                                    std::to_string(x) + ", " + std::to_string(y) +
                                                    ": values from 0 to 8e37 are allowed.");
        }
      }
      const Rgbe rgbe = encode(values);
      for (size_t c = 0; c < 4; ++c) {
        channels[c * width + static_cast<size_t>(x)] = rgbe[c];
        if (!runs) bytes.push_back(static_cast<std::byte>(rgbe[c]));
      }
    }
    if (!runs) continue;
    append(bytes, "\2\2");
    bytes.push_back(static_cast<std::byte>(image.width >> 8));
    bytes.push_back(static_cast<std::byte>(image.width & 255));
    for (size_t c = 0; c < 4; ++c)
      append_runs(bytes, std::span(channels).subspan(c * width, width));
  }
  return bytes;
}

}  // namespace lightkiln

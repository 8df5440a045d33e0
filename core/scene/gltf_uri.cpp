// Sources: RFC 2397 (data), RFC 3986 (generic syntax), RFC 4648 (base64).

#include "core/scene/gltf_uri.h"

#include <array>
#include <cstdint>
#include <string_view>

#include "core/base/error.h"

namespace lightkiln {

[[noreturn]] static void refuse(const std::string& sentence, const std::string& where) {
  throw Error(ErrorCode::invalid_input, sentence, where);
}

bool is_data_uri(const std::string& uri) {
  return uri.starts_with("data:");
}

// --- Base64 --------------------------------------------------------------------------------------

static constexpr std::array<int8_t, 256> make_base64_table() {
  std::array<int8_t, 256> table{};
  table.fill(-1);
  constexpr std::string_view kAlphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < kAlphabet.size(); ++i) {
    table[static_cast<unsigned char>(kAlphabet[i])] = static_cast<int8_t>(i);
  }
  return table;
}

std::vector<std::byte> decode_data_uri(const std::string& uri, const std::string& where) {
  static constexpr auto kTable = make_base64_table();
  const size_t comma = uri.find(',');
  if (comma == std::string::npos || !std::string_view(uri).substr(0, comma).ends_with(";base64")) {
    refuse("A data URI in a glTF must read 'data:<type>;base64,<data>'.", where);
  }
  std::string_view text = std::string_view(uri).substr(comma + 1);
  // Padding may be left out, but where it stands it must complete a group of four.
  if (text.ends_with('=')) {
    if (text.size() % 4 != 0) refuse("The base64 of this data URI is padded wrongly.", where);
    text.remove_suffix(text.ends_with("==") ? 2 : 1);
  }
  if (text.size() % 4 == 1) refuse("The base64 of this data URI ends inside a byte.", where);
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const int value = kTable[static_cast<unsigned char>(c)];
    if (value < 0) refuse("This data URI holds a character that is not base64.", where);
    bits = (bits << 6) | static_cast<uint32_t>(value);
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes.push_back(static_cast<std::byte>((bits >> held) & 0xff));
    }
  }
  return bytes;
}

// --- Names ---------------------------------------------------------------------------------------

static int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

static std::string percent_decoded(const std::string& uri, const std::string& where) {
  std::string name;
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      name += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = i + 2 < uri.size() ? hex_digit(uri[i + 2]) : -1;
    if (high < 0 || low < 0) refuse("The URI holds a '%' without two hexadecimal digits.", where);
    name += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return name;
}

static bool has_scheme(const std::string& uri) {
  const size_t end = uri.find_first_of(":/?#");
  return end != std::string::npos && uri[end] == ':';
}

std::string resource_name(const std::string& uri, const std::string& where) {
  if (has_scheme(uri)) {
    refuse("URIs in a glTF must be relative or data URIs; this one names a scheme.", where);
  }
  std::string name = percent_decoded(uri, where);
  for (const char c : name) {
    if (static_cast<unsigned char>(c) < 0x20) refuse("The URI holds a control character.", where);
  }
  if (name.starts_with('/') || name.starts_with('\\')) {
    refuse("URIs in a glTF must be relative; this one is an absolute path.", where);
  }
  while (name.starts_with("./")) name.erase(0, 2);
  for (size_t start = 0; start <= name.size();) {
    const size_t end = std::min(name.find_first_of("/\\", start), name.size());
    if (name.compare(start, end - start, "..") == 0) {
      refuse("URIs in a glTF must not leave its folder; this one holds '..'.", where);
    }
    start = end + 1;
  }
  if (name.empty()) refuse("The URI is empty.", where);
  return name;
}

}  // namespace lightkiln

// The one place of this floor that includes the JSON library, which tinygltf brings along. Only its
// event parser is used: it does not recurse, and the events let depth, size and repeated keys be
// refused while they happen.

#include "core/scene/gltf_preflight.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "core/base/error.h"

namespace lightkiln {

// --- Container -----------------------------------------------------------------------------------

static constexpr uint32_t kGlbMagic = 0x46546c67;  // "glTF"
static constexpr uint32_t kJsonChunk = 0x4e4f534a;
static constexpr uint32_t kBinChunk = 0x004e4942;

static uint32_t read_u32(std::span<const std::byte> bytes, size_t offset) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) {
    value |= static_cast<uint32_t>(bytes[offset + i]) << (8 * i);
  }
  return value;
}

[[noreturn]] static void refuse(const std::string& sentence) {
  throw Error(ErrorCode::invalid_input, sentence);
}

static void add_chunk(GltfContainer& container, uint32_t type, std::span<const std::byte> body,
                      bool first) {
  if (first && type != kJsonChunk) refuse("The GLB's first chunk must be its JSON.");
  if (type == kJsonChunk) {
    if (!first) refuse("The GLB holds two JSON chunks; one is allowed.");
    if (body.empty()) refuse("The GLB's JSON chunk is empty.");
    container.json = body;
  } else if (type == kBinChunk) {
    if (container.has_bin) refuse("The GLB holds two binary chunks; one is allowed.");
    container.bin = body;
    container.has_bin = true;
  }
}

GltfContainer open_gltf_container(std::span<const std::byte> file) {
  if (file.empty()) refuse("The glTF file is empty.");
  GltfContainer container;
  if (file.size() < 4 || read_u32(file, 0) != kGlbMagic) {
    container.json = file;
    return container;
  }
  if (file.size() < 12) refuse("The GLB ends inside its 12-byte header.");
  container.is_glb = true;
  const uint32_t version = read_u32(file, 4);
  if (version != 2) {
    throw Error(ErrorCode::unsupported, "The GLB is of container version " +
                                            std::to_string(version) + "; version 2 is supported.");
  }
  const uint64_t length = read_u32(file, 8);
  if (length != file.size()) {
    refuse("The GLB's header states " + std::to_string(length) + " bytes, but the file has " +
           std::to_string(file.size()) + ".");
  }
  size_t offset = 12;
  while (offset < file.size()) {
    if (file.size() - offset < 8) refuse("The GLB ends inside a chunk header.");
    const size_t size = read_u32(file, offset);
    if (size > file.size() - offset - 8) {
      refuse("A GLB chunk of " + std::to_string(size) + " bytes at byte " + std::to_string(offset) +
             " reaches past the end of the file.");
    }
    add_chunk(container, read_u32(file, offset + 4), file.subspan(offset + 8, size), offset == 12);
    offset += 8 + size;
  }
  if (container.json.empty()) refuse("The GLB holds no chunk at all; its JSON is missing.");
  return container;
}

// --- JSON ----------------------------------------------------------------------------------------

namespace {

class TreeBuilder {
 public:
  JsonValue root;

  bool null() { return add(nullptr); }
  bool boolean(bool value) { return add(value); }
  bool number_integer(int64_t value) { return add(static_cast<double>(value)); }
  bool number_unsigned(uint64_t value) { return add(static_cast<double>(value)); }
  bool number_float(double value, const std::string&) { return add(value); }
  bool string(std::string& value) { return add(std::move(value)); }
  bool binary(nlohmann::json::binary_t&) { return false; }
  bool start_object(size_t) { return open(JsonObject{}); }
  bool start_array(size_t) { return open(JsonArray{}); }
  bool end_array() { return close(); }
  bool end_object() {
    refuse_repeated_keys(*stack_.back()->object());
    return close();
  }
  bool key(std::string& name) {
    stack_.back()->object()->push_back({std::move(name), {}});
    return true;
  }
  bool parse_error(size_t position, const std::string&, const nlohmann::json::exception&) {
    refuse("The glTF's JSON is malformed at byte " + std::to_string(position) + ".");
  }

 private:
  template <typename T>
  bool add(T&& value) {
    place().data = std::forward<T>(value);
    return true;
  }

  template <typename T>
  bool open(T&& container) {
    if (stack_.size() >= kMaxJsonDepth) {
      throw Error(ErrorCode::too_large, "The glTF's JSON is nested deeper than " +
                                            std::to_string(kMaxJsonDepth) + " levels.");
    }
    JsonValue& value = place();
    value.data = std::forward<T>(container);
    stack_.push_back(&value);
    return true;
  }

  bool close() {
    stack_.pop_back();
    return true;
  }

  // Where the next value goes. A container's address is stable while it is open, because nothing is
  // added to its parent meanwhile.
  JsonValue& place() {
    if (++count_ > kMaxJsonValues) {
      throw Error(ErrorCode::too_large,
                  "The glTF's JSON holds more than " + std::to_string(kMaxJsonValues) + " values.");
    }
    if (stack_.empty()) return root;
    if (JsonArray* items = stack_.back()->array()) return items->emplace_back();
    return stack_.back()->object()->back().value;
  }

  static void refuse_repeated_keys(const JsonObject& members) {
    std::vector<std::string_view> keys;
    keys.reserve(members.size());
    for (const JsonMember& member : members) keys.push_back(member.key);
    std::sort(keys.begin(), keys.end());
    const auto twice = std::adjacent_find(keys.begin(), keys.end());
    if (twice != keys.end()) {
      refuse("The glTF's JSON names the key '" + std::string(twice->substr(0, 80)) +
             "' twice in one object.");
    }
  }

  std::vector<JsonValue*> stack_;
  size_t count_ = 0;
};

}  // namespace

JsonValue parse_gltf_json(std::span<const std::byte> text, uint64_t max_bytes) {
  if (text.size() > max_bytes) {
    throw Error(ErrorCode::too_large, "The glTF's JSON has " + std::to_string(text.size()) +
                                          " bytes; at most " + std::to_string(max_bytes) +
                                          " are allowed.");
  }
  const char* first = reinterpret_cast<const char*>(text.data());
  if (text.size() >= 3 && std::string_view(first, 3) == "\xef\xbb\xbf") {
    refuse("The glTF's JSON starts with a byte order mark, which glTF forbids.");
  }
  TreeBuilder builder;
  nlohmann::json::sax_parse(first, first + text.size(), &builder);
  if (!builder.root.object()) refuse("The root of the glTF's JSON must be an object.");
  return std::move(builder.root);
}

}  // namespace lightkiln

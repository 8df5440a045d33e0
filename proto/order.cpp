#include "proto/order.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "core/base/error.h"
#include "proto/digest.h"
#include "proto/json_value.h"
#include "proto/json_writer.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxGltfBytes = 64 << 20;

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || fs::is_directory(path))
    throw Error(ErrorCode::not_found, "The file " + path.string() + " cannot be read.");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::string percent_decode(std::string_view text) {
  const auto digit = [](char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool escaped =
        text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0;
    out += escaped ? static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2])) : text[i];
    if (escaped) i += 2;
  }
  return out;
}

// Without this check an order from somewhere else could have any file of this machine uploaded.
void refuse_escape(const std::string& uri) {
  const fs::path path(uri);
  const bool upwards = std::find(path.begin(), path.end(), "..") != path.end();
  if (uri.empty() || path.is_absolute() || upwards || uri.find(':') != std::string::npos ||
      uri.find('\\') != std::string::npos || uri.find('\0') != std::string::npos)
    throw Error(ErrorCode::invalid_spec,
                "The glTF names the file \"" + uri.substr(0, 200) +
                    "\"; only relative paths without \"..\" below its own folder are taken.");
}

// A name without ".." can still be a link that leads out, which the same order may have brought.
fs::path resource_below(const fs::path& folder, const std::string& uri) {
  std::error_code missing;
  const fs::path root = fs::canonical(folder.empty() ? "." : folder, missing);
  const fs::path target = fs::canonical(folder / uri, missing);
  if (missing) return folder / uri;  // reading it says what is wrong
  if (std::mismatch(root.begin(), root.end(), target.begin(), target.end()).first != root.end())
    throw Error(ErrorCode::invalid_spec, "The file \"" + uri.substr(0, 200) +
                                             "\" of the glTF is a link that leads out of its "
                                             "folder; only files below the folder are taken.");
  return target;
}

class Resolver {
 public:
  explicit Resolver(const fs::path& folder) : folder_(folder) {}

  // An input of any of the four forms, as digests.
  JsonValue input(const JsonValue& given, const std::string& pointer) {
    if (const std::string* text = given.string()) {
      const fs::path path = folder_ / *text;
      const std::string main = file_or_digest(*text, pointer);
      if (is_digest(*text) || !is_gltf(path)) return JsonValue(main);
      JsonValue::Object resources = gltf_resources(path, pointer);
      if (resources.empty()) return JsonValue(main);
      return JsonValue(JsonValue::Object{{"blob", JsonValue(main)},
                                         {"resources", JsonValue(std::move(resources))}});
    }
    if (!given.object()) return given;  // the server says what is wrong with it
    JsonValue copy = given;
    for (JsonMember& member : *copy.object()) {
      const std::string at = pointer + "/" + json_pointer_token(member.key);
      if (member.key == "blob" && member.value.string())
        member.value = JsonValue(file_or_digest(*member.value.string(), at));
      const bool files = member.key == "resources" || member.key == "faces";
      if (!files || !member.value.object()) continue;
      for (JsonMember& file : *member.value.object())
        if (file.value.string())
          file.value = JsonValue(
              file_or_digest(*file.value.string(), at + "/" + json_pointer_token(file.key)));
    }
    return copy;
  }

  std::vector<OrderBlob> take() { return std::move(blobs_); }

 private:
  std::string file_or_digest(const std::string& text, const std::string& pointer) {
    return is_digest(text) ? text : add_file(folder_ / text, pointer);
  }

  std::string add_file(const fs::path& path, const std::string& pointer) {
    FileDigest hashed;
    try {
      hashed = sha256_file(path);
    } catch (const Error& error) {
      throw Error(ErrorCode::invalid_spec, error.what(), pointer);
    }
    const auto known = std::find_if(blobs_.begin(), blobs_.end(), [&](const OrderBlob& blob) {
      return blob.digest == hashed.digest;
    });
    if (known == blobs_.end()) blobs_.push_back({hashed.digest, path, hashed.bytes});
    return hashed.digest;
  }

  static bool is_gltf(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    return extension == ".gltf";
  }

  JsonValue::Object gltf_resources(const fs::path& path, const std::string& pointer) {
    JsonValue::Object resources;
    for (const std::string& uri : gltf_file_uris(read_text(path)))
      resources.push_back(
          {uri, JsonValue(add_file(resource_below(path.parent_path(), uri), pointer))});
    return resources;
  }

  fs::path folder_;
  std::vector<OrderBlob> blobs_;
};

}  // namespace

std::vector<std::string> gltf_file_uris(std::string_view gltf_json) {
  std::vector<SpecFault> faults;
  const JsonValue gltf = read_json(gltf_json, JsonLimits{kMaxGltfBytes, 64}, &faults);
  if (!faults.empty())
    throw Error(ErrorCode::invalid_spec, "The glTF cannot be read: " + faults[0].message);
  std::vector<std::string> uris;
  for (const char* list : {"buffers", "images"}) {
    const JsonValue* items = gltf.find(list);
    if (!items || !items->array()) continue;
    for (const JsonValue& item : *items->array()) {
      const JsonValue* uri = item.find("uri");
      if (!uri || !uri->string() || uri->string()->starts_with("data:")) continue;
      const std::string name = percent_decode(*uri->string());
      refuse_escape(name);
      if (std::find(uris.begin(), uris.end(), name) == uris.end()) uris.push_back(name);
    }
  }
  return uris;
}

Order read_order(const fs::path& path) {
  const std::string text = read_text(path);
  std::vector<SpecFault> faults;
  JsonValue order = read_json(text, JsonLimits{}, &faults);
  if (!faults.empty())
    throw Error(ErrorCode::invalid_spec, path.string() + ": " + faults[0].message,
                faults[0].pointer);
  if (!order.object())
    throw Error(ErrorCode::invalid_spec, path.string() + " must hold an object: a spec.");
  Resolver resolver(path.parent_path());
  for (JsonMember& member : *order.object()) {
    if (member.key != "inputs" || !member.value.object()) continue;
    for (JsonMember& input : *member.value.object())
      input.value = resolver.input(input.value, "/inputs/" + json_pointer_token(input.key));
  }
  JsonWriter writer;
  writer.value(order);
  return {writer.take(), resolver.take()};
}

}  // namespace lightkiln

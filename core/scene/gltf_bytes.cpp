#include "core/scene/gltf_bytes.h"

#include "core/base/error.h"
#include "core/scene/gltf_meshopt.h"
#include "core/scene/gltf_uri.h"

namespace lightkiln {

static std::string place(const char* section, size_t index) {
  return std::string("/") + section + "/" + std::to_string(index);
}

GltfBytes::GltfBytes(const GltfFile& file, const GltfSource& source)
    : file_(file),
      source_(source),
      buffers_(file.buffers.size()),
      views_(file.views.size()),
      images_(file.images.size()) {
  const auto check = [](const std::optional<std::string>& uri,
                        std::optional<std::vector<std::byte>>& slot, const std::string& where) {
    if (!uri) return;
    if (is_data_uri(*uri)) {
      slot = decode_data_uri(*uri, where);
    } else {
      resource_name(*uri, where);
    }
  };
  for (size_t i = 0; i < file.buffers.size(); ++i) {
    check(file.buffers[i].uri, buffers_[i], place("buffers", i) + "/uri");
  }
  for (size_t i = 0; i < file.images.size(); ++i) {
    check(file.images[i].uri, images_[i], place("images", i) + "/uri");
  }
}

std::span<const std::byte> GltfBytes::named(const std::string& uri, const std::string& where) {
  const std::string name = resource_name(uri, where);
  const auto found = source_.resources.find(name);
  if (found == source_.resources.end()) {
    throw Error(ErrorCode::invalid_input,
                "The glTF names the file '" + name + "', which was not handed over with it.",
                where);
  }
  return found->second;
}

bool GltfBytes::defined(size_t buffer_index) const {
  const GltfBuffer& buffer = file_.buffers[buffer_index];
  return buffer.uri || (buffer_index == 0 && file_.container.has_bin && !buffer.fallback);
}

std::span<const std::byte> GltfBytes::buffer(size_t index) {
  const GltfBuffer& buffer = file_.buffers[index];
  const std::string where = place("buffers", index);
  if (!defined(index)) {
    throw Error(ErrorCode::invalid_input,
                "Buffer " + std::to_string(index) +
                    " is used but has neither a URI nor a GLB's binary chunk behind it.",
                where);
  }
  std::span<const std::byte> bytes = file_.container.bin;
  if (buffer.uri) {
    bytes = buffers_[index] ? std::span<const std::byte>(*buffers_[index])
                            : named(*buffer.uri, where + "/uri");
  }
  if (bytes.size() < buffer.length) {
    throw Error(ErrorCode::invalid_input,
                "Buffer " + std::to_string(index) + " states " + std::to_string(buffer.length) +
                    " bytes, but only " + std::to_string(bytes.size()) + " were handed over.",
                where + "/byteLength");
  }
  return bytes;
}

std::span<const std::byte> GltfBytes::view(size_t index) {
  const GltfView& view = file_.views[index];
  if (!view.meshopt) return buffer(view.buffer).subspan(view.offset, view.length);
  if (!views_[index]) {
    const MeshoptStream& stream = *view.meshopt;
    views_[index] =
        decode_meshopt(stream, buffer(stream.buffer).subspan(stream.offset, stream.length),
                       place("bufferViews", index));
  }
  return *views_[index];
}

std::span<const std::byte> GltfBytes::image(size_t index) {
  const GltfImage& image = file_.images[index];
  if (image.view) return view(*image.view);
  if (images_[index]) return *images_[index];
  return named(*image.uri, place("images", index) + "/uri");
}

}  // namespace lightkiln

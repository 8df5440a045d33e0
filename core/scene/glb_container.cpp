// Source: Khronos Group, glTF 2.0 specification, "GLB File Format Specification".

#include "core/scene/glb_container.h"

#include "core/base/error.h"

namespace lightkiln {

namespace {

void append_u32(std::vector<std::byte>& bytes, size_t value) {
  for (int shift = 0; shift < 32; shift += 8) {
    bytes.push_back(static_cast<std::byte>((value >> shift) & 0xff));
  }
}

}  // namespace

std::vector<std::byte> glb_container(const std::string& json, std::span<const std::byte> bin) {
  const size_t json_size = (json.size() + 3) / 4 * 4;
  const size_t bin_size = (bin.size() + 3) / 4 * 4;
  const size_t total = 12 + 8 + json_size + (bin.empty() ? 0 : 8 + bin_size);
  if (total > 0xffffffffu) {
    throw Error(ErrorCode::too_large, "The written scene would exceed a GLB's 4 GiB.");
  }
  std::vector<std::byte> bytes;
  bytes.reserve(total);
  append_u32(bytes, 0x46546c67);
  append_u32(bytes, 2);
  append_u32(bytes, total);
  append_u32(bytes, json_size);
  append_u32(bytes, 0x4e4f534a);
  const auto text = std::as_bytes(std::span(json));
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes.resize(20 + json_size, std::byte{' '});
  if (bin.empty()) return bytes;
  append_u32(bytes, bin_size);
  append_u32(bytes, 0x004e4942);
  bytes.insert(bytes.end(), bin.begin(), bin.end());
  bytes.resize(total, std::byte{0});
  return bytes;
}

}  // namespace lightkiln

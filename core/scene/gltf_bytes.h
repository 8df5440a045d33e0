#pragma once

// The bytes behind buffers, views and images of a checked glTF: from the GLB's chunk, a data URI, a
// file handed over, or a compressed stream. What nothing reads may be absent.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/scene/gltf_file.h"

namespace lightkiln {

class GltfBytes {
 public:
  // Both must outlive this object. Checks every URI and unpacks every data URI at once, also those
  // of what is never used.
  GltfBytes(const GltfFile& file, const GltfSource& source);

  // False for a buffer of undefined contents: no URI and no binary chunk, which a file may have as
  // long as nothing reads it.
  bool defined(size_t buffer_index) const;
  // At least the buffer's stated length. Throws Error{invalid_input}: a missing or short file, by
  // name.
  std::span<const std::byte> buffer(size_t index);
  // Exactly the view's stated length, decompressed where need be.
  std::span<const std::byte> view(size_t index);
  // The encoded image.
  std::span<const std::byte> image(size_t index);

 private:
  std::span<const std::byte> named(const std::string& uri, const std::string& where);

  const GltfFile& file_;
  const GltfSource& source_;
  // Unpacked from data URIs (buffers, images) and compressed streams (views).
  std::vector<std::optional<std::vector<std::byte>>> buffers_, views_, images_;
};

}  // namespace lightkiln

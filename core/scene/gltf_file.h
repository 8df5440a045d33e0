#pragma once

// A glTF whose every property, index, byte range and count has been checked against the file's own
// sections. What is dangerous to get wrong (buffers, views, accessors, images) is read here; the
// rest of the tree is left in `json`, now safe to hand to tinygltf.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/gltf.h"
#include "core/scene/gltf_json.h"
#include "core/scene/gltf_preflight.h"

namespace lightkiln {

struct GltfBuffer {
  uint64_t length = 0;
  std::optional<std::string> uri;  // absent: the GLB's binary chunk, or nothing
  bool fallback = false;           // holds nothing; only compressed views refer to it
};

enum class MeshoptMode { attributes, triangles, indices };
enum class MeshoptFilter { none, octahedral, quaternion, exponential };

// EXT_meshopt_compression: where the compressed bytes lie and what they unfold to.
struct MeshoptStream {
  size_t buffer = 0;
  uint64_t offset = 0, length = 0, stride = 0, count = 0;
  MeshoptMode mode = MeshoptMode::attributes;
  MeshoptFilter filter = MeshoptFilter::none;
};

struct GltfView {
  size_t buffer = 0;
  uint64_t offset = 0, length = 0;
  uint64_t stride = 0;  // 0 = elements follow one another
  std::optional<MeshoptStream> meshopt;
};

enum class ComponentType {
  i8 = 5120,
  u8 = 5121,
  i16 = 5122,
  u16 = 5123,
  u32 = 5125,
  f32 = 5126,
};
size_t component_size(ComponentType type);

struct GltfSparse {
  uint64_t count = 0;
  size_t index_view = 0, value_view = 0;
  uint64_t index_offset = 0, value_offset = 0;
  ComponentType index_type = ComponentType::u32;
};

struct GltfAccessor {
  std::optional<size_t> view;  // absent: zeros (before `sparse`)
  uint64_t offset = 0;
  ComponentType component = ComponentType::f32;
  bool normalized = false;
  uint64_t count = 0;
  size_t rows = 1;     // components of a vector, rows of a matrix
  size_t columns = 1;  // 1 unless a matrix
  std::optional<GltfSparse> sparse;

  size_t components() const { return rows * columns; }
  size_t column_stride() const;  // bytes; columns of a matrix start at multiples of four
  size_t element_size() const;   // bytes from the first component to past the last one
  size_t packed_stride() const;  // bytes from one element to the next without a byteStride
};

struct GltfImage {
  std::optional<std::string> uri;
  std::optional<size_t> view;
  std::string mime_type;
};

struct GltfFile {
  GltfContainer container;
  JsonValue json;
  std::vector<GltfBuffer> buffers;
  std::vector<GltfView> views;
  std::vector<GltfAccessor> accessors;
  std::vector<GltfImage> images;
  std::vector<std::string> warnings;  // sentences about what was ignored
};

// Opens, parses and checks. `main` must outlive the result. Throws as load_gltf.
GltfFile open_gltf(std::span<const std::byte> main, const GltfLimits& limits);

// The steps of open_gltf after parsing, in this order.
void check_extensions(GltfFile& file);         // gltf_extensions.cpp
void check_schema(GltfFile& file);             // gltf_schema.cpp: kinds, ranges, references
void read_sections(GltfFile& file);            // gltf_file.cpp: buffers, views, accessors, images
void check_node_forest(const GltfFile& file);  // gltf_forest.cpp

// How many elements a top-level array has; 0 when it is absent.
size_t section_size(const JsonValue& root, std::string_view name);

inline constexpr size_t kMaxNodeDepth = 256;

}  // namespace lightkiln

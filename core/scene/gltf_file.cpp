#include "core/scene/gltf_file.h"

#include "core/base/error.h"

namespace lightkiln {

// --- Sizes ---------------------------------------------------------------------------------------

size_t component_size(ComponentType type) {
  switch (type) {
    case ComponentType::i8:
    case ComponentType::u8:
      return 1;
    case ComponentType::i16:
    case ComponentType::u16:
      return 2;
    default:
      return 4;
  }
}

size_t GltfAccessor::column_stride() const {
  const size_t column = rows * component_size(component);
  return columns > 1 ? (column + 3) / 4 * 4 : column;
}
size_t GltfAccessor::element_size() const {
  return (columns - 1) * column_stride() + rows * component_size(component);
}
size_t GltfAccessor::packed_stride() const {
  return columns * column_stride();
}

// --- Reading sections ----------------------------------------------------------------------------

namespace {

constexpr uint64_t kMaxCount = uint64_t{1} << 40;

// `size` elements of `element` bytes, `stride` apart, from `offset`: do they end within `length`?
// Every operand is below 2^41 and the stride below 2^9, so that nothing overflows 64 bits.
bool fits(uint64_t offset, uint64_t count, uint64_t stride, uint64_t element, uint64_t length) {
  return offset <= length && (count - 1) * stride + element <= length - offset;
}

ComponentType component_type(const JsonAt& at, bool sparse_index = false) {
  const uint64_t code = at.integer(0, 0xffff);
  const bool unsigned_type = code == 5121 || code == 5123 || code == 5125;
  if (!unsigned_type && (sparse_index || (code != 5120 && code != 5122 && code != 5126))) {
    at.fail("Component type " + std::to_string(code) + " is not one that glTF allows here.");
  }
  return static_cast<ComponentType>(code);
}

GltfBuffer read_buffer(const JsonAt& at) {
  GltfBuffer buffer;
  buffer.length = at.at("byteLength").integer(1, kMaxCount);
  if (const auto uri = at.find("uri")) buffer.uri = uri->string();
  if (const JsonValue* extensions = at.value().find("extensions")) {
    for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
      const JsonValue* extension = extensions->find(name);
      const JsonValue* fallback = extension ? extension->find("fallback") : nullptr;
      const bool* value = fallback ? std::get_if<bool>(&fallback->data) : nullptr;
      if (value && *value) buffer.fallback = true;
    }
  }
  return buffer;
}

MeshoptStream read_meshopt(const JsonAt& at, uint64_t view_length) {
  MeshoptStream stream;
  stream.buffer = at.at("buffer").integer(0, kMaxCount);
  stream.offset = at.integer_or("byteOffset", 0, 0, kMaxCount);
  stream.length = at.at("byteLength").integer(1, kMaxCount);
  stream.stride = at.at("byteStride").integer(1, 256);
  stream.count = at.at("count").integer(1, kMaxCount);
  const std::string& mode = at.at("mode").string();
  if (mode == "TRIANGLES") {
    stream.mode = MeshoptMode::triangles;
  } else if (mode == "INDICES") {
    stream.mode = MeshoptMode::indices;
  } else if (mode != "ATTRIBUTES") {
    at.at("mode").fail("The compression mode must be ATTRIBUTES, TRIANGLES or INDICES.");
  }
  const auto filter = at.find("filter");
  const std::string name = filter ? filter->string() : "NONE";
  if (name == "OCTAHEDRAL") {
    stream.filter = MeshoptFilter::octahedral;
  } else if (name == "QUATERNION") {
    stream.filter = MeshoptFilter::quaternion;
  } else if (name == "EXPONENTIAL") {
    stream.filter = MeshoptFilter::exponential;
  } else if (name != "NONE") {
    throw Error(ErrorCode::unsupported,
                "The meshopt filter must be NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL.",
                filter->where());
  }
  const bool attributes = stream.mode == MeshoptMode::attributes;
  const bool stride_ok =
      attributes ? stream.stride % 4 == 0 : stream.stride == 2 || stream.stride == 4;
  const bool filter_ok =
      stream.filter == MeshoptFilter::none ||
      (attributes &&
       (stream.filter != MeshoptFilter::octahedral || stream.stride == 4 || stream.stride == 8) &&
       (stream.filter != MeshoptFilter::quaternion || stream.stride == 8));
  const bool count_ok = stream.mode != MeshoptMode::triangles || stream.count % 3 == 0;
  if (!stride_ok || !filter_ok || !count_ok) {
    at.fail("The stride, count or filter of this compressed view does not fit its mode.");
  }
  if (stream.count * stream.stride != view_length) {
    at.fail("The compressed view unfolds to " + std::to_string(stream.count * stream.stride) +
            " bytes, but the view states " + std::to_string(view_length) + ".");
  }
  // A block of 256 elements takes at least 4 bytes for each byte of the element, an index at least
  // one: nothing valid unfolds more than 64 times. Larger claims are refused before allocation.
  if (view_length / 64 > stream.length + 1024) {
    at.fail("The compressed view claims more data than its bytes can hold.");
  }
  return stream;
}

GltfView read_view(const JsonAt& at, const std::vector<GltfBuffer>& buffers) {
  GltfView view;
  view.buffer = at.at("buffer").integer(0, kMaxCount);
  view.offset = at.integer_or("byteOffset", 0, 0, kMaxCount);
  view.length = at.at("byteLength").integer(1, kMaxCount);
  view.stride = at.integer_or("byteStride", 0, 0, 256);
  const auto within = [&](const JsonAt& place, size_t buffer, uint64_t offset, uint64_t length) {
    if (!fits(offset, 1, 0, length, buffers[buffer].length)) {
      place.fail("Bytes " + std::to_string(offset) + " to " + std::to_string(offset + length) +
                 " reach past the end of buffer " + std::to_string(buffer) + ", which has " +
                 std::to_string(buffers[buffer].length) + ".");
    }
  };
  within(at, view.buffer, view.offset, view.length);
  if (view.stride % 4 != 0) at.at("byteStride").fail("'byteStride' must be a multiple of 4.");
  if (view.stride > view.length) at.at("byteStride").fail("'byteStride' is larger than the view.");
  if (const auto extensions = at.find("extensions")) {
    for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
      const auto extension = extensions->find(name);
      if (!extension || view.meshopt) continue;
      view.meshopt = read_meshopt(*extension, view.length);
      within(*extension, view.meshopt->buffer, view.meshopt->offset, view.meshopt->length);
    }
  }
  if (view.stride > 252 && !view.meshopt) at.at("byteStride").fail("'byteStride' is above 252.");
  return view;
}

void set_shape(GltfAccessor& accessor, const JsonAt& type) {
  struct Shape {
    const char* name;
    size_t rows, columns;
  };
  static constexpr Shape kShapes[] = {{"SCALAR", 1, 1}, {"VEC2", 2, 1}, {"VEC3", 3, 1},
                                      {"VEC4", 4, 1},   {"MAT2", 2, 2}, {"MAT3", 3, 3},
                                      {"MAT4", 4, 4}};
  for (const Shape& shape : kShapes) {
    if (type.string() == shape.name) {
      accessor.rows = shape.rows;
      accessor.columns = shape.columns;
      return;
    }
  }
  type.fail("The accessor's type must be SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4.");
}

GltfSparse read_sparse(const JsonAt& at, const GltfAccessor& accessor,
                       const std::vector<GltfView>& views) {
  GltfSparse sparse;
  sparse.count = at.at("count").integer(1, kMaxCount);
  if (sparse.count > accessor.count) {
    at.at("count").fail("A sparse accessor cannot replace more elements than it has.");
  }
  const JsonAt indices = at.at("indices");
  const JsonAt values = at.at("values");
  sparse.index_view = indices.at("bufferView").integer(0, kMaxCount);
  sparse.index_offset = indices.integer_or("byteOffset", 0, 0, kMaxCount);
  sparse.index_type = component_type(indices.at("componentType"), true);
  sparse.value_view = values.at("bufferView").integer(0, kMaxCount);
  sparse.value_offset = values.integer_or("byteOffset", 0, 0, kMaxCount);
  const size_t index_size = component_size(sparse.index_type);
  if (!fits(sparse.index_offset, sparse.count, index_size, index_size,
            views[sparse.index_view].length)) {
    indices.fail("The sparse indices reach past the end of their buffer view.");
  }
  if (!fits(sparse.value_offset, sparse.count, accessor.packed_stride(), accessor.element_size(),
            views[sparse.value_view].length)) {
    values.fail("The sparse values reach past the end of their buffer view.");
  }
  return sparse;
}

GltfAccessor read_accessor(const JsonAt& at, const std::vector<GltfView>& views) {
  GltfAccessor accessor;
  accessor.component = component_type(at.at("componentType"));
  accessor.count = at.at("count").integer(1, kMaxCount);
  accessor.offset = at.integer_or("byteOffset", 0, 0, kMaxCount);
  set_shape(accessor, at.at("type"));
  if (const auto normalized = at.find("normalized")) accessor.normalized = normalized->boolean();
  if (const auto view = at.find("bufferView")) {
    accessor.view = view->integer(0, kMaxCount);
    const GltfView& bytes = views[*accessor.view];
    const uint64_t stride = bytes.stride != 0 ? bytes.stride : accessor.packed_stride();
    if (stride < accessor.element_size()) {
      at.fail("The accessor's elements are larger than the stride of their buffer view.");
    }
    if (!fits(accessor.offset, accessor.count, stride, accessor.element_size(), bytes.length)) {
      at.fail("The accessor's " + std::to_string(accessor.count) +
              " elements reach past the end of their buffer view, which has " +
              std::to_string(bytes.length) + " bytes.");
    }
  } else if (at.find("byteOffset")) {
    at.fail("The accessor has a byte offset but no buffer view.");
  }
  if (const auto sparse = at.find("sparse")) {
    accessor.sparse = read_sparse(*sparse, accessor, views);
  }
  return accessor;
}

GltfImage read_image(const JsonAt& at) {
  GltfImage image;
  if (const auto uri = at.find("uri")) image.uri = uri->string();
  if (const auto view = at.find("bufferView")) image.view = view->integer(0, kMaxCount);
  if (const auto mime = at.find("mimeType")) image.mime_type = mime->string();
  if (image.uri.has_value() == image.view.has_value()) {
    at.fail("An image must have either a URI or a buffer view.");
  }
  return image;
}

template <typename T, typename Read>
std::vector<T> read_all(const JsonAt& root, const char* name, const Read& read) {
  std::vector<T> elements;
  if (const auto section = root.find(name)) {
    elements.reserve(section->size());
    for (size_t i = 0; i < section->size(); ++i) elements.push_back(read((*section)[i]));
  }
  return elements;
}

// Only the GLB's binary chunk and meshopt's placeholders come without a URI.
void check_uriless_buffers(const GltfFile& file) {
  for (size_t i = 1; i < file.buffers.size(); ++i) {
    if (!file.buffers[i].uri && !file.buffers[i].fallback) {
      throw Error(ErrorCode::invalid_input,
                  "Only the first buffer may come without a URI (it is the GLB's binary chunk).",
                  "/buffers/" + std::to_string(i));
    }
  }
}

}  // namespace

void read_sections(GltfFile& file) {
  const JsonAt root(file.json, "");
  file.buffers = read_all<GltfBuffer>(root, "buffers", read_buffer);
  check_uriless_buffers(file);
  file.views = read_all<GltfView>(root, "bufferViews",
                                  [&](const JsonAt& at) { return read_view(at, file.buffers); });
  file.accessors = read_all<GltfAccessor>(
      root, "accessors", [&](const JsonAt& at) { return read_accessor(at, file.views); });
  file.images = read_all<GltfImage>(root, "images", read_image);
}

GltfFile open_gltf(std::span<const std::byte> main, const GltfLimits& limits) {
  GltfFile file;
  file.container = open_gltf_container(main);
  file.json = parse_gltf_json(file.container.json, limits.max_json_bytes);
  check_extensions(file);
  check_schema(file);
  read_sections(file);
  check_node_forest(file);
  return file;
}

}  // namespace lightkiln

#include "core/scene/gltf_accessors.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/base/error.h"

namespace lightkiln {

namespace {

template <typename T>
T load(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

// glTF 2.0, section 3.6.2.2: f = c / max for unsigned, f = max(c / max, -1) for signed types.
template <typename T>
float widen(const std::byte* from, bool normalized) {
  const T value = load<T>(from);
  if constexpr (std::is_same_v<T, float>) {
    return value;
  } else {
    if (!normalized) return static_cast<float>(value);
    const double ratio =
        static_cast<double>(value) / static_cast<double>(std::numeric_limits<T>::max());
    return static_cast<float>(std::max(ratio, -1.0));
  }
}

float component_as_float(const std::byte* from, ComponentType type, bool normalized) {
  switch (type) {
    case ComponentType::i8:
      return widen<int8_t>(from, normalized);
    case ComponentType::u8:
      return widen<uint8_t>(from, normalized);
    case ComponentType::i16:
      return widen<int16_t>(from, normalized);
    case ComponentType::u16:
      return widen<uint16_t>(from, normalized);
    case ComponentType::u32:
      return widen<uint32_t>(from, normalized);
    case ComponentType::f32:
      return widen<float>(from, normalized);
  }
  return 0;
}

uint32_t component_as_unsigned(const std::byte* from, ComponentType type) {
  switch (type) {
    case ComponentType::u8:
      return load<uint8_t>(from);
    case ComponentType::u16:
      return load<uint16_t>(from);
    default:
      return load<uint32_t>(from);
  }
}

std::string place(size_t accessor) {
  return "/accessors/" + std::to_string(accessor);
}

// Strictly rising and below the accessor's count.
std::vector<uint32_t> sparse_indices(const AccessorSource& source, size_t index) {
  const GltfAccessor& accessor = source.file.accessors[index];
  const GltfSparse& sparse = *accessor.sparse;
  const std::byte* bytes = source.bytes.view(sparse.index_view).data() + sparse.index_offset;
  const size_t size = component_size(sparse.index_type);
  std::vector<uint32_t> indices(sparse.count);
  for (size_t i = 0; i < indices.size(); ++i) {
    indices[i] = component_as_unsigned(bytes + i * size, sparse.index_type);
    if (indices[i] >= accessor.count || (i > 0 && indices[i] <= indices[i - 1])) {
      throw Error(ErrorCode::invalid_input,
                  "The sparse indices must rise strictly and stay below the accessor's count.",
                  place(index) + "/sparse/indices");
    }
  }
  return indices;
}

// Calls put(element, component, bytes of the component) for every value, the sparse ones last.
template <typename Put>
void for_each_component(const AccessorSource& source, size_t index, const Put& put) {
  const GltfAccessor& accessor = source.file.accessors[index];
  const size_t size = component_size(accessor.component);
  const auto element = [&](size_t i, const std::byte* from) {
    for (size_t column = 0; column < accessor.columns; ++column) {
      for (size_t row = 0; row < accessor.rows; ++row) {
        put(i, column * accessor.rows + row, from + column * accessor.column_stride() + row * size);
      }
    }
  };
  const auto found =
      source.decoded ? source.decoded->find(index) : DecodedAccessors::const_iterator();
  if (source.decoded && found != source.decoded->end()) {
    for (size_t i = 0; i < accessor.count; ++i) {
      element(i, found->second.data() + i * accessor.packed_stride());
    }
    return;
  }
  if (accessor.view) {
    const GltfView& view = source.file.views[*accessor.view];
    const size_t stride = view.stride != 0 ? view.stride : accessor.packed_stride();
    const std::byte* base = source.bytes.view(*accessor.view).data() + accessor.offset;
    for (size_t i = 0; i < accessor.count; ++i) element(i, base + i * stride);
  }
  if (accessor.sparse) {
    const std::vector<uint32_t> targets = sparse_indices(source, index);
    const std::byte* base =
        source.bytes.view(accessor.sparse->value_view).data() + accessor.sparse->value_offset;
    for (size_t k = 0; k < targets.size(); ++k) {
      element(targets[k], base + k * accessor.packed_stride());
    }
  }
}

}  // namespace

std::vector<float> read_floats(const AccessorSource& source, size_t accessor) {
  const GltfAccessor& a = source.file.accessors[accessor];
  const size_t components = a.components();
  std::vector<float> values(a.count * components, 0.0f);
  for_each_component(source, accessor, [&](size_t i, size_t component, const std::byte* from) {
    values[i * components + component] = component_as_float(from, a.component, a.normalized);
  });
  return values;
}

std::vector<uint32_t> read_unsigned(const AccessorSource& source, size_t accessor) {
  const GltfAccessor& a = source.file.accessors[accessor];
  if (a.component != ComponentType::u8 && a.component != ComponentType::u16 &&
      a.component != ComponentType::u32) {
    throw Error(ErrorCode::invalid_input,
                "This accessor must hold unsigned integers (component type 5121, 5123 or 5125).",
                place(accessor) + "/componentType");
  }
  const size_t components = a.components();
  std::vector<uint32_t> values(a.count * components, 0);
  for_each_component(source, accessor, [&](size_t i, size_t component, const std::byte* from) {
    values[i * components + component] = component_as_unsigned(from, a.component);
  });
  return values;
}

}  // namespace lightkiln

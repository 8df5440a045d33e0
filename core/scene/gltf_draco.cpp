#include "core/scene/gltf_draco.h"

#include <cstring>
#include <exception>

// Draco's headers do not follow our warnings.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#include <draco/compression/decode.h>
#pragma GCC diagnostic pop

#include "core/base/error.h"

namespace lightkiln {

namespace {

[[noreturn]] void refuse(const std::string& sentence, const std::string& where) {
  throw Error(ErrorCode::invalid_input, sentence, where);
}

template <typename T>
std::vector<std::byte> convert(const draco::PointAttribute& attribute, size_t points,
                               size_t components, const std::string& where) {
  std::vector<T> values(points * components);
  for (size_t point = 0; point < points; ++point) {
    const auto index = attribute.mapped_index(draco::PointIndex(static_cast<uint32_t>(point)));
    if (index.value() >= attribute.size() ||
        !attribute.ConvertValue<T>(index, static_cast<int8_t>(components),
                                   &values[point * components])) {
      refuse("A value of the Draco stream does not fit its accessor.", where);
    }
  }
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

std::vector<std::byte> convert(const draco::PointAttribute& attribute, const GltfAccessor& accessor,
                               const std::string& where) {
  const size_t points = accessor.count, components = accessor.components();
  switch (accessor.component) {
    case ComponentType::i8:
      return convert<int8_t>(attribute, points, components, where);
    case ComponentType::u8:
      return convert<uint8_t>(attribute, points, components, where);
    case ComponentType::i16:
      return convert<int16_t>(attribute, points, components, where);
    case ComponentType::u16:
      return convert<uint16_t>(attribute, points, components, where);
    case ComponentType::u32:
      return convert<uint32_t>(attribute, points, components, where);
    case ComponentType::f32:
      return convert<float>(attribute, points, components, where);
  }
  return {};
}

template <typename T>
std::vector<std::byte> triangle_indices(const draco::Mesh& mesh) {
  std::vector<T> values;
  values.reserve(size_t{mesh.num_faces()} * 3);
  for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face) {
    for (int corner = 0; corner < 3; ++corner) {
      values.push_back(static_cast<T>(mesh.face(face)[static_cast<size_t>(corner)].value()));
    }
  }
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

std::unique_ptr<draco::Mesh> decode_mesh(std::span<const std::byte> compressed,
                                         const std::string& where) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(compressed.data()), compressed.size());
  draco::Decoder decoder;
  try {
    auto result = decoder.DecodeMeshFromBuffer(&buffer);
    if (!result.ok()) {
      refuse("The Draco stream is damaged: " + result.status().error_msg_string() + ".", where);
    }
    return std::move(result).value();
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    // A damaged stream may claim sizes that no memory holds.
    refuse("The Draco stream is damaged: it claims sizes that cannot be.", where);
  }
}

}  // namespace

DecodedAccessors decode_draco(const GltfFile& file, std::span<const std::byte> compressed,
                              const std::vector<DracoRequest>& attributes, size_t indices,
                              const std::string& where) {
  const std::unique_ptr<draco::Mesh> mesh = decode_mesh(compressed, where);
  DecodedAccessors decoded;
  const GltfAccessor& index_accessor = file.accessors[indices];
  if (index_accessor.components() != 1 || index_accessor.count != uint64_t{mesh->num_faces()} * 3) {
    refuse("The Draco stream holds " + std::to_string(mesh->num_faces()) +
               " triangles, but its index accessor states " + std::to_string(index_accessor.count) +
               " indices.",
           where);
  }
  switch (index_accessor.component) {
    case ComponentType::u8:
      decoded[indices] = triangle_indices<uint8_t>(*mesh);
      break;
    case ComponentType::u16:
      decoded[indices] = triangle_indices<uint16_t>(*mesh);
      break;
    default:
      decoded[indices] = triangle_indices<uint32_t>(*mesh);
      break;
  }
  for (const DracoRequest& request : attributes) {
    const GltfAccessor& accessor = file.accessors[request.accessor];
    const draco::PointAttribute* attribute = mesh->GetAttributeByUniqueId(request.unique_id);
    if (!attribute) refuse("The Draco stream lacks an attribute that its primitive names.", where);
    if (accessor.count != mesh->num_points() || accessor.columns != 1 ||
        attribute->num_components() != accessor.components()) {
      refuse("The Draco stream holds " + std::to_string(mesh->num_points()) +
                 " points, but an accessor of its primitive states " +
                 std::to_string(accessor.count) + ", or another shape.",
             where);
    }
    decoded[request.accessor] = convert(*attribute, accessor, where);
  }
  return decoded;
}

}  // namespace lightkiln

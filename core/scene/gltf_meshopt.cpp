#include "core/scene/gltf_meshopt.h"

#include <meshoptimizer.h>

#include "core/base/error.h"

namespace lightkiln {

// The decoders are safe on untrusted bytes; what they write may still be any index or value, and is
// checked like everything else that comes out of a view.
std::vector<std::byte> decode_meshopt(const MeshoptStream& stream,
                                      std::span<const std::byte> compressed,
                                      const std::string& where) {
  std::vector<std::byte> bytes(stream.count * stream.stride);
  const auto* input = reinterpret_cast<const unsigned char*>(compressed.data());
  int status = 0;
  switch (stream.mode) {
    case MeshoptMode::attributes:
      status = meshopt_decodeVertexBuffer(bytes.data(), stream.count, stream.stride, input,
                                          compressed.size());
      break;
    case MeshoptMode::triangles:
      status = meshopt_decodeIndexBuffer(bytes.data(), stream.count, stream.stride, input,
                                         compressed.size());
      break;
    case MeshoptMode::indices:
      status = meshopt_decodeIndexSequence(bytes.data(), stream.count, stream.stride, input,
                                           compressed.size());
      break;
  }
  if (status != 0) {
    throw Error(ErrorCode::invalid_input,
                "The meshopt-compressed view is damaged or of a version above 0 (decoder status " +
                    std::to_string(status) + ").",
                where);
  }
  switch (stream.filter) {
    case MeshoptFilter::none:
      break;
    case MeshoptFilter::octahedral:
      meshopt_decodeFilterOct(bytes.data(), stream.count, stream.stride);
      break;
    case MeshoptFilter::quaternion:
      meshopt_decodeFilterQuat(bytes.data(), stream.count, stream.stride);
      break;
    case MeshoptFilter::exponential:
      meshopt_decodeFilterExp(bytes.data(), stream.count, stream.stride);
      break;
  }
  return bytes;
}

}  // namespace lightkiln

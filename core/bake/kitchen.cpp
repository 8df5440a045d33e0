#include "core/bake/kitchen.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/environment/cube_faces.h"
#include "core/image/decode.h"
#include "core/image/shrink.h"

namespace lightkiln {

namespace {

std::span<const std::byte> blob_of(const std::string& digest, const Inputs& inputs) {
  const auto found = inputs.blobs.find(digest);
  if (found == inputs.blobs.end())
    throw Error(ErrorCode::not_found, "The blob " + digest + " was not handed to the bake.");
  return found->second;
}

}  // namespace

std::span<const std::byte> blob_bytes(const InputRef& ref, const Inputs& inputs) {
  return blob_of(ref.blob, inputs);
}

DecodedImage decode_environment(const InputRef& ref, const Inputs& inputs) {
  if (ref.faces.empty()) return decode_light_image(blob_bytes(ref, inputs));
  CubeOfFaces cube;
  for (size_t i = 0; i < kCubeFaceNames.size(); ++i) {
    DecodedImage face;
    try {
      face = decode_light_image(blob_of(ref.faces.at(i), inputs));
    } catch (const Error& error) {
      throw Error(error.code(), std::string("The face ") + kCubeFaceNames[i] + ": " + error.what(),
                  error.where());
    }
    cube.add(std::move(face));
  }
  return cube.take();
}

std::vector<std::string> source_warnings(const InputRef& ref, const Inputs& inputs,
                                         const SourceParameters& parameters,
                                         const DecodedImage& decoded) {
  std::vector<std::string> warnings = light_warnings(decoded);
  const std::string read_as = face_orientation_name(parameters.face_orientation);
  const LayoutKind kind = environment_reading(ref, parameters).layout.value_or(LayoutKind::latlong);
  if (kind != LayoutKind::cube_strip) return warnings;
  std::vector<std::string> files = ref.faces;
  if (files.empty()) files.push_back(ref.blob);
  for (const std::string& digest : files) {
    const std::string said = exr_text(blob_of(digest, inputs), kFaceOrientationAttribute);
    if (said.empty() || said == read_as) continue;
    warnings.push_back("The file says that its faces are turned as " + printable(said) +
                       "; source.face_orientation reads them as " + read_as + ".");
    break;
  }
  return warnings;
}

SourceReading environment_reading(const InputRef& ref, const SourceParameters& parameters) {
  SourceReading reading = reading_of(parameters);
  if (!ref.faces.empty()) reading.layout = LayoutKind::cube_strip;
  return reading;
}

GltfSource gltf_source(const InputRef& ref, const Inputs& inputs) {
  GltfSource source;
  source.main = blob_bytes(ref, inputs);
  for (const auto& [uri, digest] : ref.resources)
    source.resources.emplace(uri, blob_of(digest, inputs));
  return source;
}

void add_scene_report(const SceneReport& report, Plan* plan) {
  const std::pair<const char*, uint64_t> counts[] = {
      {"dropped_nan_vertices", report.dropped_nan_vertices},
      {"dropped_infinite_vertices", report.dropped_infinite_vertices},
      {"dropped_oversize_vertices", report.dropped_oversize_vertices},
      {"dropped_degenerate_triangles", report.dropped_degenerate_triangles},
      {"dropped_duplicate_triangles", report.dropped_duplicate_triangles},
      {"dropped_broken_triangles", report.dropped_broken_triangles},
      {"repaired_normals", report.repaired_normals},
      {"meshes_without_normals", report.meshes_without_normals},
      {"ignored_points_and_lines", report.ignored_points_and_lines},
      {"open_edges", report.open_edges},
      {"inconsistent_edges", report.inconsistent_edges},
  };
  for (const auto& [name, count] : counts)
    if (count > 0) plan->repairs.emplace_back(name, count);
  plan->warnings.insert(plan->warnings.end(), report.warnings.begin(), report.warnings.end());
}

std::vector<ElementRange> split_chunks(uint64_t elements, double predicted_s, double seconds_each) {
  constexpr double kMostChunks = 4096;
  const double ratio = seconds_each > 0 ? predicted_s / seconds_each : 1;
  const double wanted = std::isfinite(ratio) ? std::clamp(std::round(ratio), 1.0, kMostChunks) : 1;
  const uint64_t count =
      std::max<uint64_t>(1, std::min<uint64_t>(static_cast<uint64_t>(wanted), elements));
  std::vector<ElementRange> chunks;
  for (uint64_t i = 0; i < count; ++i) {
    const uint64_t first = elements * i / count;
    chunks.push_back({first, elements * (i + 1) / count - first});
  }
  return chunks;
}

namespace {

void add_exr(const std::string& name, const Image& image, std::vector<std::byte> bytes,
             Assembly* assembly) {
  assembly->artifacts.push_back({name, "image", "image/x-exr", std::move(bytes)});
  if (assembly->pictures.size() < kMostPictures)
    assembly->pictures.push_back({name, shrink(image, kPictureSide)});
}

}  // namespace

void add_image(const std::string& name, const Image& image, const ExrWriteOptions& options,
               Assembly* assembly) {
  add_exr(name, image, write_exr(image, options), assembly);
}

void add_mip_mapped_image(const std::string& name, std::span<const Image> levels,
                          const ExrWriteOptions& options, Assembly* assembly) {
  add_exr(name, levels.front(), write_exr_mipmapped(levels, options), assembly);
}

std::string describe_strip(FaceOrientation faces) {
  return std::string("cube: six faces from the top, +X -X +Y -Y +Z -Z") +
         (faces == FaceOrientation::opengl ? " of the world (-x, y, z), as OpenGL looks them up"
                                           : ", as OpenEXR orients them");
}

Image ordered_faces(Image strip, FaceOrientation faces) {
  return faces == FaceOrientation::opengl ? strip_to_opengl(strip) : std::move(strip);
}

void tell_faces(FaceOrientation faces, std::map<std::string, std::string>* attributes) {
  if (faces == FaceOrientation::openexr) return;
  (*attributes)[kFaceOrientationAttribute] = face_orientation_name(faces);
}

static_assert(std::endian::native == std::endian::little,
              "chunk bytes are written as they lie in memory");

namespace {

template <typename T>
void append(std::vector<std::byte>& bytes, const T* values, size_t count) {
  const size_t old = bytes.size();
  bytes.resize(old + count * sizeof(T));
  if (count > 0) std::memcpy(bytes.data() + old, values, count * sizeof(T));
}

template <typename T>
void extract(std::span<const std::byte>& bytes, T* values, size_t count) {
  if (bytes.size() / sizeof(T) < count)
    throw Error(ErrorCode::internal, "A chunk's bytes end early.");
  if (count > 0) std::memcpy(values, bytes.data(), count * sizeof(T));
  bytes = bytes.subspan(count * sizeof(T));
}

template <typename T>
T extract_one(std::span<const std::byte>& bytes) {
  T value;
  extract(bytes, &value, 1);
  return value;
}

}  // namespace

void ByteWriter::u64(uint64_t value) {
  append(bytes_, &value, 1);
}
void ByteWriter::u32(uint32_t value) {
  append(bytes_, &value, 1);
}
void ByteWriter::f64(double value) {
  append(bytes_, &value, 1);
}
void ByteWriter::f32(float value) {
  append(bytes_, &value, 1);
}
void ByteWriter::floats(std::span<const float> values) {
  append(bytes_, values.data(), values.size());
}

void ByteWriter::sized(std::span<const std::byte> bytes) {
  u64(bytes.size());
  append(bytes_, bytes.data(), bytes.size());
}

uint64_t ByteReader::u64() {
  return extract_one<uint64_t>(bytes_);
}
uint32_t ByteReader::u32() {
  return extract_one<uint32_t>(bytes_);
}
double ByteReader::f64() {
  return extract_one<double>(bytes_);
}
float ByteReader::f32() {
  return extract_one<float>(bytes_);
}
void ByteReader::floats(std::span<float> values) {
  extract(bytes_, values.data(), values.size());
}
std::vector<std::byte> ByteReader::sized() {
  const uint64_t size = u64();
  if (size > bytes_.size()) throw Error(ErrorCode::internal, "Chunk bytes end early.");
  std::vector<std::byte> taken(static_cast<size_t>(size));
  extract(bytes_, taken.data(), taken.size());
  return taken;
}

}  // namespace lightkiln

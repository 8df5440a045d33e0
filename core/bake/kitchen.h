#pragma once

// The seam inside the front door: each kind of bake is four functions over its own loaded state.
// Bake switches on the kind once and calls these; nothing else includes this header.

#include "core/bake/bake.h"
#include "core/environment/environment.h"
#include "core/image/exr.h"
#include "core/scene/gltf.h"

namespace lightkiln {

// Inputs as bytes, looked up by the spec's digests. Throws Error{not_found} for a missing blob.
GltfSource gltf_source(const InputRef& ref, const Inputs& inputs);
std::span<const std::byte> blob_bytes(const InputRef& ref, const Inputs& inputs);
// Decodes the environment's file or its six, see decode_light_image() and CubeOfFaces, whose
// errors it throws, with the face's name where it is one of six.
DecodedImage decode_environment(const InputRef& ref, const Inputs& inputs);
// What a plan warns of: light_warnings() of what was decoded, and files that say that their faces
// are turned otherwise than the order reads them.
std::vector<std::string> source_warnings(const InputRef& ref, const Inputs& inputs,
                                         const SourceParameters& parameters,
                                         const DecodedImage& decoded);
// How it is to be read: six files are a cube_strip.
SourceReading environment_reading(const InputRef& ref, const SourceParameters& parameters);

// What loading repaired or ignored, as the plan lists it.
void add_scene_report(const SceneReport& report, Plan* plan);

// Splits [0, elements) into equal chunks of about `seconds_each`, at least one.
std::vector<ElementRange> split_chunks(uint64_t elements, double predicted_s, double seconds_each);

// Adds an image as the OpenEXR artifact `name`, and its picture as long as there is room for more.
// Levels go into one mip-mapped file, whose picture is that of level 0.
void add_image(const std::string& name, const Image& image, const ExrWriteOptions& options,
               Assembly* assembly);
void add_mip_mapped_image(const std::string& name, std::span<const Image> levels,
                          const ExrWriteOptions& options, Assembly* assembly);

// Of a strip of faces, for its text attribute.
std::string describe_strip(FaceOrientation faces);
// A strip of faces, made in our orientation, as the order has it filed.
Image ordered_faces(Image strip, FaceOrientation faces);
// Adds to the text attributes of a file of faces what is to be said of their orientation.
void tell_faces(FaceOrientation faces, std::map<std::string, std::string>* attributes);

// One pointer-free serialisation for chunk bytes: little-endian, in call order.
class ByteWriter {
 public:
  void u64(uint64_t value);
  void u32(uint32_t value);
  void f64(double value);
  void f32(float value);
  void floats(std::span<const float> values);
  void sized(std::span<const std::byte> bytes);  // their number before them
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};
// Throws Error{internal} when the bytes end early: a chunk of another engine or a torn file.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  uint64_t u64();
  uint32_t u32();
  double f64();
  float f32();
  void floats(std::span<float> values);
  std::vector<std::byte> sized();
  bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const std::byte> bytes_;
};

// core/bake/ambient_occlusion.cpp
struct AoState;
struct AoStateDeleter {
  void operator()(AoState* state) const;
};
std::unique_ptr<AoState, AoStateDeleter> ao_open(const Spec& spec, const Inputs& inputs,
                                                 const Grants& grants);
Plan ao_plan(AoState& state, Progress& progress);
ChunkResult ao_chunk(AoState& state, const Plan& plan, const ElementRange& range,
                     Progress& progress);
Assembly ao_assemble(AoState& state, const Plan& plan, std::span<const ChunkResult> chunks,
                     Progress& progress);

// core/bake/environment_maps.cpp
struct EnvironmentMapsState;
struct EnvironmentMapsStateDeleter {
  void operator()(EnvironmentMapsState* state) const;
};
std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter> environment_maps_open(
    const Spec& spec, const Inputs& inputs, const Grants& grants);
Plan environment_maps_plan(EnvironmentMapsState& state, Progress& progress);
ChunkResult environment_maps_chunk(EnvironmentMapsState& state, const Plan& plan,
                                   const ElementRange& range, Progress& progress);
Assembly environment_maps_assemble(EnvironmentMapsState& state, const Plan& plan,
                                   std::span<const ChunkResult> chunks, Progress& progress);

// core/bake/probes.cpp
struct ProbesState;
struct ProbesStateDeleter {
  void operator()(ProbesState* state) const;
};
std::unique_ptr<ProbesState, ProbesStateDeleter> probes_open(const Spec& spec, const Inputs& inputs,
                                                             const Grants& grants);
Plan probes_plan(ProbesState& state, Progress& progress);
ChunkResult probes_chunk(ProbesState& state, const Plan& plan, const ElementRange& range,
                         Progress& progress);
Assembly probes_assemble(ProbesState& state, const Plan& plan, std::span<const ChunkResult> chunks,
                         Progress& progress);

}  // namespace lightkiln

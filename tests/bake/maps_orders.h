#pragma once

// Orders of environment maps in tests: one map under one digest, baked in one call.

#include <string>
#include <vector>

#include "core/bake/bake.h"
#include "core/image/exr.h"

namespace lightkiln::test {

inline const std::string kDigest = "sha256:" + std::string(64, 'a');

inline Spec order(const EnvironmentMapsParameters& parameters) {
  Spec spec;
  spec.environment = InputRef{kDigest, {}};
  spec.parameters = parameters;
  return spec;
}

// 32-bit floats, so that what is baked is what the test made.
inline std::vector<std::byte> exr_of(const Image& image,
                                     EnvmapAttribute envmap = EnvmapAttribute::none) {
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  options.envmap = envmap;
  return write_exr(image, options);
}

inline Assembly bake(const Spec& spec, const std::vector<std::byte>& file, int threads = 1,
                     Plan* plan = nullptr) {
  Inputs inputs;
  inputs.blobs[kDigest] = file;
  Grants grants;
  grants.threads = threads;
  Progress progress;
  return bake_all(spec, inputs, grants, progress, plan);
}

inline const EnvironmentDocument& document_of(const Assembly& assembly) {
  return std::get<EnvironmentDocument>(assembly.document);
}

}  // namespace lightkiln::test

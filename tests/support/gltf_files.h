#pragma once

// A glTF with everything that lies beside it, as a client would hand it over.

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/scene/gltf.h"

namespace lightkiln::test {

struct GltfFiles {
  std::vector<std::byte> main;
  std::map<std::string, std::vector<std::byte>> resources;

  GltfSource source() const;
};

// The file, and every other file in or below its folder, keyed by relative path.
GltfFiles read_gltf_files(const std::filesystem::path& path);

// World-space bounds of the triangles of a loaded scene.
Bounds world_bounds(const Scene& scene);

}  // namespace lightkiln::test

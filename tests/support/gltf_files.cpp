#include "tests/support/gltf_files.h"

#include "tests/support/data.h"

namespace lightkiln::test {

GltfSource GltfFiles::source() const {
  GltfSource source;
  source.main = main;
  for (const auto& [name, bytes] : resources) source.resources[name] = bytes;
  return source;
}

GltfFiles read_gltf_files(const std::filesystem::path& path) {
  GltfFiles files;
  files.main = read_file(path);
  const auto folder = path.parent_path();
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file() || entry.path() == path) continue;
    files.resources[std::filesystem::relative(entry.path(), folder).string()] =
        read_file(entry.path());
  }
  return files;
}

Bounds world_bounds(const Scene& scene) {
  return {scene.normalisation.to_world(scene.bounds.lower),
          scene.normalisation.to_world(scene.bounds.upper)};
}

}  // namespace lightkiln::test

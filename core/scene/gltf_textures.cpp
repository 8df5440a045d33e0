#include "core/scene/gltf_textures.h"

#include "core/base/error.h"
#include "core/image/ldr.h"

namespace lightkiln {

namespace {

class TextureLoader {
 public:
  TextureLoader(Scene& scene, const GltfModel& model, GltfBytes& bytes,
                const GltfLoadOptions& options)
      : scene_(scene),
        model_(model),
        bytes_(bytes),
        options_(options),
        loaded_(model.textures.size(), kUnseen) {}

  void resolve(TextureSlot& slot) {
    if (slot.texture < 0) return;
    int& index = loaded_[static_cast<size_t>(slot.texture)];
    if (index == kUnseen) index = load(static_cast<size_t>(slot.texture));
    slot.texture = index;
  }

 private:
  static constexpr int kUnseen = -2;

  int load(size_t index) {
    const GltfTexture& from = model_.textures[index];
    if (from.image < 0) {
      scene_.report.warnings.push_back(
          "Texture " + std::to_string(index) +
          " is ignored: it has no PNG or JPEG image (other formats need extensions that are not "
          "supported).");
      return -1;
    }
    Texture texture;
    texture.name = from.name;
    texture.wrap_s = from.wrap_s;
    texture.wrap_t = from.wrap_t;
    texture.nearest = from.nearest;
    if (options_.textures) decode(texture, static_cast<size_t>(from.image));
    scene_.textures.push_back(std::move(texture));
    return static_cast<int>(scene_.textures.size() - 1);
  }

  void decode(Texture& texture, size_t image) {
    const std::string where = "/images/" + std::to_string(image);
    Image8 pixels;
    try {
      pixels = read_ldr(bytes_.image(image));
    } catch (const Error& error) {
      // The image reader does not know where in the glTF it stands.
      if (!error.where().empty()) throw;
      throw Error(error.code(), error.what(), where);
    }
    const auto texels = static_cast<uint64_t>(pixels.width) * static_cast<uint64_t>(pixels.height);
    texels_ += texels;
    if (texels_ > options_.limits.max_texels) {
      throw Error(ErrorCode::too_large,
                  "The textures have more than " + std::to_string(options_.limits.max_texels) +
                      " texels together.",
                  where);
    }
    texture.width = pixels.width;
    texture.height = pixels.height;
    texture.rgba = std::move(pixels.pixels);
  }

  Scene& scene_;
  const GltfModel& model_;
  GltfBytes& bytes_;
  const GltfLoadOptions& options_;
  std::vector<int> loaded_;
  uint64_t texels_ = 0;
};

}  // namespace

void load_textures(Scene& scene, const GltfModel& model, GltfBytes& bytes,
                   const GltfLoadOptions& options) {
  std::vector<bool> used(scene.materials.size(), false);
  for (const SurfaceMesh& mesh : scene.meshes) used[static_cast<size_t>(mesh.material)] = true;
  TextureLoader loader(scene, model, bytes, options);
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    for (TextureSlot* slot :
         {&scene.materials[i].base_color_texture, &scene.materials[i].emissive_texture}) {
      if (used[i]) {
        loader.resolve(*slot);
      } else {
        slot->texture = -1;
      }
    }
  }
}

}  // namespace lightkiln

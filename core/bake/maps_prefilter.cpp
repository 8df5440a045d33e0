// Prefiltered chains: GGX, and Charlie for sheen. Each level is an output of its own.

#include <algorithm>
#include <memory>
#include <utility>

#include "core/bake/maps_cube.h"
#include "core/base/text.h"
#include "core/environment/charlie_lobe.h"
#include "core/image/exr.h"

namespace lightkiln {

namespace {

// What the levels of one chain share: the images that a mip-mapped file still waits for.
struct Chain {
  LobeKind kind;
  PrefilterOutput order;
  std::vector<double> roughness;
  std::vector<Image> pending;

  bool sheen() const { return kind == LobeKind::charlie; }
  std::string name() const { return sheen() ? "sheen" : "prefilter"; }
  std::map<std::string, std::string> attributes() const {
    return {{"lightkiln.quantity", sheen() ? "radiance prefiltered with Charlie, n = v = r"
                                           : "radiance prefiltered with GGX, n = v = r"}};
  }
};

// GGX of roughness 0 is the map itself; a ring of no width would be no image.
std::optional<Lobe> level_lobe(const Chain& chain, double roughness) {
  if (!chain.sheen() && roughness == 0) return std::nullopt;
  return Lobe{chain.kind, roughness * roughness};
}

class ChainLevel : public ConvolvedCube {
 public:
  ChainLevel(MapsLight& light, std::shared_ptr<Chain> chain, int level, double target)
      : ConvolvedCube(light, chain->order.size >> level,
                      level_lobe(*chain, chain->roughness[static_cast<size_t>(level)]), 1, target),
        chain_(std::move(chain)),
        level_(level),
        roughness_(chain_->roughness[static_cast<size_t>(level)]) {}

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    const bool mapped = chain_->order.packaging == Packaging::mip_mapped;
    std::string name = chain_->name();
    if (!mapped) name.append("_").append(std::to_string(level_));
    name.append(".exr");
    std::map<std::string, std::string> attributes = chain_->attributes();
    if (mapped) {
      add_to_file(read(reader), name, attributes, result);
    } else {
      attributes["lightkiln.roughness"] = short_number(roughness_);
      add_cube(name, read(reader), attributes, result);
    }
    auto& levels = chain_->sheen() ? result->document.sheen : result->document.prefilter;
    levels.push_back({name, size(), roughness_, error_bound(), measured, level_, result->faces});
  }

 private:
  // Levels are filed in their order; the last one completes the file.
  void add_to_file(Image image, const std::string& name,
                   std::map<std::string, std::string> attributes, MapsResult* result) const {
    chain_->pending.push_back(std::move(image));
    if (chain_->pending.size() < chain_->roughness.size()) return;
    std::string list;
    for (const double r : chain_->roughness) {
      if (!list.empty()) list.append(" ");
      list.append(short_number(r));
    }
    attributes["lightkiln.roughness"] = list;
    add_mip_mapped_cube(name, std::exchange(chain_->pending, {}), attributes, result);
  }

  std::shared_ptr<Chain> chain_;
  int level_;
  double roughness_;
};

void order_chain(LobeKind kind, const PrefilterOutput& order, MapsLight& light, double target,
                 MapsOutputs* outputs) {
  const auto chain = std::make_shared<Chain>(Chain{kind, order, order.roughness, {}});
  if (order.roughness_scale != RoughnessScale::custom)
    chain->roughness = level_roughness(order.roughness_scale, order.levels);
  for (double& r : chain->roughness) {
    if (kind == LobeKind::charlie) r = std::max(r, kMinSheenRoughness);
  }
  for (int level = 0; level < order.levels; ++level) {
    outputs->push_back(std::make_unique<ChainLevel>(light, chain, level, target));
  }
}

}  // namespace

const MapsProduct kPrefilterProduct = {
    "prefilter", "A chain prefiltered with GGX is ordered.", true,
    [](const EnvironmentMapsParameters& p) { return p.prefilter.has_value(); },
    [](const EnvironmentMapsParameters& p, MapsLight& light, double target, MapsOutputs* outputs) {
      order_chain(LobeKind::ggx, *p.prefilter, light, target, outputs);
    }};

const MapsProduct kSheenProduct = {
    "sheen", "A chain prefiltered with Charlie is ordered.", true,
    [](const EnvironmentMapsParameters& p) { return p.sheen.has_value(); },
    [](const EnvironmentMapsParameters& p, MapsLight& light, double target, MapsOutputs* outputs) {
      order_chain(LobeKind::charlie, *p.sheen, light, target, outputs);
    }};

}  // namespace lightkiln

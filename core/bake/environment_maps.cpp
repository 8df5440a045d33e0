#include "core/bake/kitchen.h"

namespace lightkiln {

struct EnvironmentMapsState {};

void EnvironmentMapsStateDeleter::operator()(EnvironmentMapsState* state) const {
  delete state;
}

namespace {
[[noreturn]] void refuse() {
  throw Error(ErrorCode::unsupported, "This build does not bake environment_maps.", "/kind");
}
}  // namespace

std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter> environment_maps_open(
    const Spec&, const Inputs&, const Grants&) {
  refuse();
}
Plan environment_maps_plan(EnvironmentMapsState&, Progress&) {
  refuse();
}
ChunkResult environment_maps_chunk(EnvironmentMapsState&, const Plan&, const ElementRange&,
                                   Progress&) {
  refuse();
}
Assembly environment_maps_assemble(EnvironmentMapsState&, const Plan&, std::span<const ChunkResult>,
                                   Progress&) {
  refuse();
}

}  // namespace lightkiln

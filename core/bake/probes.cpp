#include "core/bake/kitchen.h"

namespace lightkiln {

struct ProbesState {};

void ProbesStateDeleter::operator()(ProbesState* state) const {
  delete state;
}

namespace {
[[noreturn]] void refuse() {
  throw Error(ErrorCode::unsupported, "This build does not bake probes.", "/kind");
}
}  // namespace

std::unique_ptr<ProbesState, ProbesStateDeleter> probes_open(const Spec&, const Inputs&,
                                                             const Grants&) {
  refuse();
}
Plan probes_plan(ProbesState&, Progress&) {
  refuse();
}
ChunkResult probes_chunk(ProbesState&, const Plan&, const ElementRange&, Progress&) {
  refuse();
}
Assembly probes_assemble(ProbesState&, const Plan&, std::span<const ChunkResult>, Progress&) {
  refuse();
}

}  // namespace lightkiln

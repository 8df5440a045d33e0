#include "core/bake/bake.h"

#include <string>

#include "core/bake/kitchen.h"

namespace lightkiln {

namespace {

using AoHandle = std::unique_ptr<AoState, AoStateDeleter>;
using EnvironmentMapsHandle = std::unique_ptr<EnvironmentMapsState, EnvironmentMapsStateDeleter>;
using ProbesHandle = std::unique_ptr<ProbesState, ProbesStateDeleter>;

void refuse_faults(const Spec& spec) {
  const std::vector<SpecFault> faults = validate(spec);
  if (!faults.empty())
    throw Error(faults.front().code == "too_large" ? ErrorCode::too_large : ErrorCode::invalid_spec,
                faults.front().message, faults.front().pointer);
}

std::variant<AoHandle, EnvironmentMapsHandle, ProbesHandle> open(const Spec& spec,
                                                                 const Inputs& inputs,
                                                                 const Grants& grants) {
  refuse_faults(spec);
  switch (spec.kind()) {
    case Kind::ambient_occlusion:
      return ao_open(spec, inputs, grants);
    case Kind::environment_maps:
      return environment_maps_open(spec, inputs, grants);
    case Kind::probes:
      return probes_open(spec, inputs, grants);
  }
  throw Error(ErrorCode::internal, "A bake of an unknown kind was asked for.");
}

}  // namespace

struct Bake::Impl {
  std::variant<AoHandle, EnvironmentMapsHandle, ProbesHandle> state;

  template <typename Ao, typename Maps, typename Probes>
  auto dispatch(Ao ao, Maps maps, Probes probes) {
    if (auto* handle = std::get_if<AoHandle>(&state)) return ao(**handle);
    if (auto* handle = std::get_if<EnvironmentMapsHandle>(&state)) return maps(**handle);
    return probes(*std::get<ProbesHandle>(state));
  }
};

Bake::Bake(const Spec& spec, const Inputs& inputs, const Grants& grants)
    : impl_(new Impl{open(spec, inputs, grants)}) {}
Bake::~Bake() = default;
Bake::Bake(Bake&&) noexcept = default;
Bake& Bake::operator=(Bake&&) noexcept = default;

Plan Bake::plan(Progress& progress) {
  return impl_->dispatch(
      [&](AoState& state) { return ao_plan(state, progress); },
      [&](EnvironmentMapsState& state) { return environment_maps_plan(state, progress); },
      [&](ProbesState& state) { return probes_plan(state, progress); });
}

ChunkResult Bake::chunk(const Plan& plan, const ElementRange& range, Progress& progress) {
  if (range.first > plan.elements || range.count > plan.elements - range.first)
    throw Error(ErrorCode::internal, "A chunk reaches past the plan's last element.");
  return impl_->dispatch(
      [&](AoState& state) { return ao_chunk(state, plan, range, progress); },
      [&](EnvironmentMapsState& state) {
        return environment_maps_chunk(state, plan, range, progress);
      },
      [&](ProbesState& state) { return probes_chunk(state, plan, range, progress); });
}

Assembly Bake::assemble(const Plan& plan, std::span<const ChunkResult> chunks, Progress& progress) {
  if (chunks.size() != plan.chunks.size())
    throw Error(ErrorCode::internal, "The plan has " + std::to_string(plan.chunks.size()) +
                                         " chunks, but " + std::to_string(chunks.size()) +
                                         " were handed to assembly.");
  return impl_->dispatch(
      [&](AoState& state) { return ao_assemble(state, plan, chunks, progress); },
      [&](EnvironmentMapsState& state) {
        return environment_maps_assemble(state, plan, chunks, progress);
      },
      [&](ProbesState& state) { return probes_assemble(state, plan, chunks, progress); });
}

Assembly bake_all(const Spec& spec, const Inputs& inputs, const Grants& grants, Progress& progress,
                  Plan* plan_out) {
  // Planning and assembling take the first and the last twentieth, chunks share the rest.
  const auto part = [&progress](double begin, double end) {
    return Progress([&progress, begin, end](double share) {
      progress.update(begin + (end - begin) * share);
      return true;
    });
  };
  Bake bake(spec, inputs, grants);
  Progress planning = part(0, 0.05);
  const Plan plan = bake.plan(planning);
  if (plan_out) *plan_out = plan;
  std::vector<ChunkResult> results;
  const double elements = static_cast<double>(std::max<uint64_t>(plan.elements, 1));
  for (const ElementRange& range : plan.chunks) {
    const double first = static_cast<double>(range.first);
    const double count = static_cast<double>(range.count);
    Progress baking = part(0.05 + 0.9 * first / elements, 0.05 + 0.9 * (first + count) / elements);
    results.push_back(bake.chunk(plan, range, baking));
  }
  Progress assembling = part(0.95, 1);
  return bake.assemble(plan, results, assembling);
}

}  // namespace lightkiln

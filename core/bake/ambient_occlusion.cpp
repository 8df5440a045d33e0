// Ambient occlusion at vertices: chunks and assembly. The plan is in ao_plan.cpp.

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/bake/ao_state.h"
#include "core/base/parallel.h"
#include "core/base/statistics.h"
#include "core/image/exr.h"
#include "core/trace/texture.h"

namespace lightkiln {

void AoStateDeleter::operator()(AoState* state) const {
  delete state;
}

std::unique_ptr<AoState, AoStateDeleter> ao_open(const Spec& spec, const Inputs& inputs,
                                                 const Grants& grants) {
  std::unique_ptr<AoState, AoStateDeleter> state(new AoState);
  state->spec = spec;
  state->grants = grants;
  state->source = gltf_source(*spec.scene, inputs);
  GltfLoadOptions options;
  options.textures = false;
  state->scene = load_gltf(state->source, options);
  const auto reads_alpha = [](const Material& material) {
    return material.alpha_mode == AlphaMode::mask && material.base_color_texture.texture >= 0;
  };
  // Only an alpha test looks at a texel.
  if (std::any_of(state->scene.materials.begin(), state->scene.materials.end(), reads_alpha)) {
    options.textures = true;
    state->scene = load_gltf(state->source, options);
  }
  TracerOptions tracing;
  tracing.build_threads = grants.threads;
  tracing.max_memory_bytes = grants.max_memory_bytes;
  state->tracer.emplace(state->scene, tracing);
  state->facets.emplace(state->scene);
  return state;
}

OpennessParameters openness_parameters(const AoState& state) {
  const AmbientOcclusionParameters& order = state.parameters();
  const double scale = state.scene.normalisation.scale();
  const double diagonal = length(state.scene.bounds.extent());
  OpennessParameters p;
  p.distribution = order.distribution;
  p.falloff = order.falloff;
  if (order.max_distance) p.max_distance = *order.max_distance * scale;
  const bool scaled_by_reach =
      order.falloff != Falloff::none && order.falloff != Falloff::exponential;
  if (!scaled_by_reach && p.max_distance > 1.01 * diagonal) p.max_distance = INFINITY;
  if (order.falloff_distance) p.falloff_distance = *order.falloff_distance * scale;
  p.target_error = target_error(state.spec);
  p.seed = state.spec.seed;
  return p;
}

OpennessBatch estimate_vertices(const AoState& state, const OpennessKernel& kernel,
                                std::span<const uint64_t> ids, bool keep_history,
                                Progress& progress) {
  constexpr size_t kBlock = 64;
  const double start_s = wall_seconds();
  OpennessBatch batch;
  batch.estimates.resize(ids.size());
  const size_t blocks = (ids.size() + kBlock - 1) / kBlock;
  std::vector<ChunkReport> reports(blocks);
  std::vector<std::vector<std::vector<double>>> histories(keep_history ? blocks : 0);
  parallel_blocks(
      ids.size(), kBlock, state.grants.threads, progress, [&](size_t begin, size_t end) {
        std::vector<Facet> facets;
        std::vector<size_t> first{0};
        for (size_t i = begin; i < end; ++i) {
          state.facets->facets(ids[i], &facets);
          first.push_back(facets.size());
        }
        std::vector<OpennessElement> elements(end - begin);
        for (size_t i = 0; i < elements.size(); ++i)
          elements[i] = {state.facets->representative(ids[begin + i]),
                         std::span(facets).subspan(first[i], first[i + 1] - first[i])};
        const size_t block = begin / kBlock;
        kernel.estimate(elements, std::span(batch.estimates).subspan(begin, end - begin),
                        &reports[block], progress, keep_history ? &histories[block] : nullptr);
      });
  batch.report.rounds = sum_rounds(reports);
  for (const ChunkReport& report : reports) {
    batch.report.elements += report.elements;
    batch.report.counters += report.counters;
    batch.report.cpu_s += report.cpu_s;
    batch.report.suspicious += report.suspicious;
    batch.report.budget_limited += report.budget_limited;
  }
  batch.report.wall_s = wall_seconds() - start_s;
  // Threads leave one round and enter the next at different times; wall time is shared out in
  // proportion to CPU time.
  for (Round& round : batch.report.rounds)
    round.wall_s =
        batch.report.cpu_s > 0 ? batch.report.wall_s * round.cpu_s / batch.report.cpu_s : 0;
  // A block that stopped earlier keeps its last errors; one without rays has none.
  for (size_t block = 0; block < histories.size(); ++block) {
    const auto& history = histories[block];
    for (size_t round = 0; round < batch.report.rounds.size(); ++round) {
      if (batch.history.size() <= round) batch.history.emplace_back(ids.size(), 0.0);
      if (history.empty()) continue;
      const std::vector<double>& errors = history[std::min(round, history.size() - 1)];
      std::copy(errors.begin(), errors.end(),
                batch.history[round].begin() + static_cast<ptrdiff_t>(block * kBlock));
    }
  }
  return batch;
}

ChunkResult ao_chunk(AoState& state, const Plan& plan, const ElementRange& range,
                     Progress& progress) {
  OpennessParameters parameters = openness_parameters(state);
  parameters.min_samples = plan.min_samples;
  parameters.max_samples = plan.max_samples;
  const OpennessKernel kernel(*state.tracer, parameters);
  std::vector<uint64_t> ids(range.count);
  std::iota(ids.begin(), ids.end(), range.first);
  OpennessBatch batch = estimate_vertices(state, kernel, ids, false, progress);
  ByteWriter writer;
  for (const OpennessEstimate& e : batch.estimates) {
    writer.f32(static_cast<float>(e.openness));
    writer.f32(static_cast<float>(e.half_width));
    writer.u32(e.samples);
    writer.u32(static_cast<uint32_t>(e.status));
  }
  return {writer.take(), std::move(batch.report)};
}

namespace {

// One value a vertex, row by row; the last row is filled up with zeros.
Image strip(std::span<const float> values, int width, int height) {
  Image image(width, height, 1);
  std::copy(values.begin(), values.end(), image.pixels.begin());
  return image;
}
ExrWriteOptions strip_options(const std::string& meaning, int threads) {
  ExrWriteOptions options;
  options.pixel_type = ExrPixelType::float32;
  options.attributes["lightkiln:meaning"] = meaning;
  options.attributes["lightkiln:engine"] = kEngineVersion;
  options.threads = threads;
  return options;
}

AoMeshIndex mesh_index(const SurfaceMesh& mesh, uint64_t first, std::span<const float> openness,
                       std::span<const AccuracyStatus> statuses) {
  AoMeshIndex index;
  index.name = mesh.name;
  index.node = mesh.node;
  index.mesh = mesh.mesh;
  index.primitive = mesh.primitive;
  index.first = first;
  index.count = openness.size();
  if (openness.empty()) return index;
  const auto [least, most] = std::minmax_element(openness.begin(), openness.end());
  index.min = static_cast<double>(*least);
  index.max = static_cast<double>(*most);
  index.mean = tree_sum(openness) / static_cast<double>(openness.size());
  const auto count_of = [&](AccuracyStatus status) {
    return static_cast<uint64_t>(std::count(statuses.begin(), statuses.end(), status));
  };
  index.suspicious = count_of(AccuracyStatus::suspicious);
  index.budget_limited = count_of(AccuracyStatus::budget_limited);
  return index;
}

AoDocument make_document(const AoState& state, std::span<const float> openness,
                         std::span<const float> errors, std::span<const AccuracyStatus> statuses) {
  AoDocument document;
  document.vertices = openness.size();
  for (size_t m = 0; m < state.scene.meshes.size(); ++m) {
    const uint64_t first = state.facets->first_vertex(m);
    const uint64_t count = state.facets->first_vertex(m + 1) - first;
    document.meshes.push_back(mesh_index(state.scene.meshes[m], first,
                                         openness.subspan(first, count),
                                         statuses.subspan(first, count)));
    document.suspicious += document.meshes.back().suspicious;
    document.budget_limited += document.meshes.back().budget_limited;
  }
  if (openness.empty()) return document;
  const auto [least, most] = std::minmax_element(openness.begin(), openness.end());
  const double count = static_cast<double>(openness.size());
  document.min = static_cast<double>(*least);
  document.max = static_cast<double>(*most);
  document.mean = tree_sum(openness) / count;
  std::vector<double> squares;
  for (const float error : errors)
    squares.push_back(static_cast<double>(error) * static_cast<double>(error));
  document.error_rms = std::sqrt(tree_sum(squares) / count);
  document.error_max = static_cast<double>(*std::max_element(errors.begin(), errors.end()));
  // As wide as a common texture, until the rows reach the format's limit.
  const size_t width = openness.size() > 1024u * 16384u ? 16384 : 1024;
  document.strip_width = static_cast<int>(std::min(openness.size(), width));
  document.strip_height = static_cast<int>((openness.size() + width - 1) / width);
  return document;
}

AccuracyStatus read_status(ByteReader* reader) {
  const uint32_t value = reader->u32();
  if (value > static_cast<uint32_t>(AccuracyStatus::exact))
    throw Error(ErrorCode::internal, "A chunk holds a vertex status that does not exist.");
  return static_cast<AccuracyStatus>(value);
}

// A price that no round reached comes from the plan's model, which knows how each vertex of the
// pilot converges, scaled by how the bake's time compared with the plan's word.
void refine_prices(const Plan& plan, AccuracyRecord* record) {
  const double pace =
      plan.predicted_s > 0 && record->actual_s > 0 ? record->actual_s / plan.predicted_s : 1;
  for (Price& price : record->time_to_error)
    for (const Price& planned : plan.prices)
      if (price.extrapolated && planned.error == price.error) {
        price.samples = planned.samples;
        price.seconds = planned.seconds * pace;
      }
}

}  // namespace

Assembly ao_assemble(AoState& state, const Plan& plan, std::span<const ChunkResult> chunks,
                     Progress& progress) {
  std::vector<float> openness, errors;
  std::vector<AccuracyStatus> statuses;
  std::vector<ChunkReport> reports;
  openness.reserve(plan.elements);
  errors.reserve(plan.elements);
  statuses.reserve(plan.elements);
  for (size_t i = 0; i < chunks.size(); ++i) {
    ByteReader reader(chunks[i].bytes);
    for (uint64_t k = 0; k < plan.chunks[i].count; ++k) {
      openness.push_back(reader.f32());
      errors.push_back(reader.f32());
      reader.u32();  // samples
      statuses.push_back(read_status(&reader));
    }
    if (!reader.at_end()) throw Error(ErrorCode::internal, "A chunk holds more than its range.");
    reports.push_back(chunks[i].report);
  }
  if (openness.size() != state.facets->vertices())
    throw Error(ErrorCode::internal, "The chunks do not cover the scene's vertices.");
  progress.update(0.2);

  Assembly assembly;
  AoDocument document = make_document(state, openness, errors, statuses);
  const VertexAttribute attributes[] = {{"_AO", openness}, {"_AO_ERROR", errors}};
  assembly.artifacts.push_back({"ambient_occlusion.glb", "glb", "model/gltf-binary",
                                write_glb(state.source, state.scene, attributes,
                                          std::string("Lightkiln ") + kEngineVersion)});
  progress.update(0.7);
  if (!openness.empty()) {
    const int width = document.strip_width;
    const int height = document.strip_height;
    const int threads = state.grants.threads;
    add_image("ambient_occlusion.exr", strip(openness, width, height),
              strip_options("openness, one pixel a vertex", threads), &assembly);
    add_image("ambient_occlusion_error.exr", strip(errors, width, height),
              strip_options("95 % half-width of openness, one pixel a vertex", threads), &assembly);
  }
  assembly.document = std::move(document);
  assembly.accuracy = summarise_accuracy(reports, target_error(state.spec), plan.predicted_s,
                                         "95 % half-width of openness, absolute");
  refine_prices(plan, &assembly.accuracy);
  progress.update(1);
  return assembly;
}

}  // namespace lightkiln

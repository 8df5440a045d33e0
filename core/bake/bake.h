#pragma once

// The front door. One object holds the decoded inputs and the BVH of a job; its three steps are
// pure functions: plan(spec, inputs), chunk(spec, plan, range) -> bytes, assemble(spec, plan, all
// bytes).
//
//   Bake bake(spec, inputs, grants);
//   Plan plan = bake.plan(progress);
//   for (range : plan.chunks) results.push_back(bake.chunk(plan, range, progress));
//   Assembly result = bake.assemble(plan, results, progress);
//
// bake_all() does exactly that in one call.

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/bake/documents.h"
#include "core/bake/plan.h"
#include "core/base/progress.h"
#include "core/image/image.h"

namespace lightkiln {

// The bytes behind a spec's digests. They outlive the Bake that they are handed to.
struct Inputs {
  std::map<std::string, std::span<const std::byte>> blobs;  // by digest "sha256:..."
};

struct ChunkResult {
  std::vector<std::byte> bytes;  // a pure function of (engine, ISA, spec, plan, range)
  ChunkReport report;
};

struct Artifact {
  std::string name;        // file name, unique in the job: "ambient_occlusion.glb"
  std::string role;        // "glb", "image", "table"
  std::string media_type;  // "model/gltf-binary", "image/x-exr"
  std::vector<std::byte> bytes;
};

// What an image artifact looks like, for people: no side above kPictureSide.
struct Picture {
  std::string artifact;
  Image pixels;
};
inline constexpr int kPictureSide = 512;     // texels
inline constexpr size_t kMostPictures = 64;  // of a job: its first images, in order

struct Assembly {
  std::vector<Artifact> artifacts;
  std::vector<Picture> pictures;
  std::variant<AoDocument, EnvironmentDocument, ProbesDocument> document;
  AccuracyRecord accuracy;
};

class Bake {
 public:
  // Decodes the inputs and builds what rays need. Throws Error.
  Bake(const Spec& spec, const Inputs& inputs, const Grants& grants);
  ~Bake();
  Bake(Bake&&) noexcept;
  Bake& operator=(Bake&&) noexcept;

  // Runs a pilot and prices the order.
  Plan plan(Progress& progress);
  ChunkResult chunk(const Plan& plan, const ElementRange& range, Progress& progress);
  // `chunks` in the order of plan.chunks.
  Assembly assemble(const Plan& plan, std::span<const ChunkResult> chunks, Progress& progress);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

Assembly bake_all(const Spec& spec, const Inputs& inputs, const Grants& grants, Progress& progress,
                  Plan* plan_out = nullptr);

}  // namespace lightkiln

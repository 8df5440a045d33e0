#pragma once

// How open a point is: the share of its hemisphere that sees no surface, weighted by a falloff.
//
//   openness = integral over the hemisphere of mu(d(w)) p(w) dw
//
// where d is the distance to the nearest surface in direction w, mu(d) = 1 where there is none
// within max_distance, and p = cos(theta) / pi (Distribution::cosine) or 1 / (2 pi) (uniform).
//
// Sampling: sixteen independent randomisations (replicates) of one point set, doubled until the
// error bar falls under the target. A result depends on (seed, element id, facets, parameters) and
// on nothing else: not on threads, blocks or neighbours.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/bake/accuracy.h"
#include "core/bake/spec.h"
#include "core/base/progress.h"
#include "core/trace/tracer.h"

namespace lightkiln {

// A place to look from. A point has one or several facets and its openness is their weighted mean.
struct Facet {
  Vec3 origin;        // already moved off the surface (offset_origin)
  Vec3 normal;        // unit
  double weight = 1;  // > 0; only ratios matter
};

struct OpennessElement {
  uint64_t id = 0;                // names the random stream
  std::span<const Facet> facets;  // none = openness 1, exactly
};

struct OpennessParameters {
  Distribution distribution = Distribution::cosine;
  Falloff falloff = Falloff::none;
  double max_distance = INFINITY;  // scene units (normalised)
  double falloff_distance = 0;     // scene units; exponential only
  double target_error = 0.02;      // 95 % half-width; 0 = spend max_samples on every element
  // Powers of two, 64 <= min <= max <= 1048576.
  uint64_t min_samples = 256;
  uint64_t max_samples = 65536;
  uint64_t seed = 0;
  // Looks for surfaces within reach before tracing: where nothing can be hit, the openness is 1
  // without a ray. Changes no value, only its bar and cost.
  bool certificates = true;
};

struct OpennessEstimate {
  double openness = 1;
  double half_width = 0;      // 95 %
  double standard_error = 0;  // behind it
  uint32_t samples = 0;
  // exact: no ray was needed; suspicious: the gate refused one of its rays.
  AccuracyStatus status = AccuracyStatus::exact;
};

class OpennessKernel {
 public:
  // Keeps a reference to `tracer`.
  OpennessKernel(const Tracer& tracer, const OpennessParameters& parameters);
  ~OpennessKernel();

  // Estimates every element of a block on the calling thread, doubling by doubling. `report` gets
  // the block's rounds, counters and CPU time (wall times stay zero). When `history` is not null,
  // history[round][i] is the standard error of element i after that round.
  void estimate(std::span<const OpennessElement> elements, std::span<OpennessEstimate> estimates,
                ChunkReport* report, const Progress& progress,
                std::vector<std::vector<double>>* history = nullptr) const;

  // The packets that estimate() traces for an element's `level`-th block of points, one a cell.
  std::vector<RayPacket16> packets(const OpennessElement& element, int level) const;

  // The distance past which no hit can change the result, in scene units.
  double reach() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The falloff mu of a hit at `distance`; reference for the kernel's own.
double falloff_weight(const OpennessParameters& parameters, double distance);

}  // namespace lightkiln

#pragma once

// Radiance over the cube around a probe, sampled in doublings of sixteen independent scramblings.
//
// A texel is the mean over its square (box filter in face coordinates). Spherical harmonics are
// integrated over the very samples, not over texels, so that they do not depend on the cube's size
// but for noise; a constant gives its exact coefficients. Every number is a pure function of (key,
// texel, replicate, index).
//
// Points in texels may all miss a sun, a small lamp, a small unlit object or a small patch of light
// that the probe sees itself, and then show no variance either. So these are looked for as well
// (RadianceScene::look), each kind as if kDirectPerSample times for each sample of a texel, and
// both ways are combined by these densities. The number is small, so that light which spans many
// texels is left to the points in texels, which are even. Of large cubes each such look is a mean
// of several: a sun that falls on few texels is most of their error, and looks cost little beside
// thousands of texels' paths.

#include <cstdint>
#include <vector>

#include "core/bake/accuracy.h"
#include "core/bake/cube_error.h"
#include "core/base/progress.h"
#include "core/base/statistics.h"
#include "core/sphere/harmonics.h"
#include "core/trace/radiance.h"

namespace lightkiln {

// Some texels of a cube with `size` texels a side.
struct CubeTexels {
  int size = 0;
  std::vector<uint32_t> texels;  // (face * size + y) * size + x: the row of the stacked image
  std::vector<double> shares;    // of the sphere, that each stands for; they sum to 1
};
CubeTexels all_texels(int size);

inline constexpr uint32_t kDirectPerSample = 16;
// How many looks stand for one, a power of two: together about a sixteenth of the texels' paths.
uint32_t looks_for_one(int size);

class CubeSampling {
 public:
  // Keeps references. `bands` = 0 leaves the harmonics out; they mean something only where `texels`
  // are all. `replicates` is at most kReplicates, and fewer tell no more than texels' variances.
  CubeSampling(const RadianceScene& scene, const CubeTexels& texels, const Vec3& origin,
               uint64_t key, int bands, int threads, int replicates = kReplicates);

  // Brings every texel to kFirstSamples a replicate, then to twice what it has. The result's
  // errors are left 0. Throws Error{cancelled}.
  Round advance(Progress& progress, double progress_begin, double progress_end);

  uint64_t samples() const;  // a texel, over all replicates
  Vec3 texel(size_t i) const;
  // 95 % half-width of a texel's luminance.
  double half_width(size_t i) const;
  double mean_luminance() const;
  // Between the replicates' means of a texel's luminance.
  double variance(size_t i) const;
  // Of the texels' luminances.
  CubeError error() const;
  // True when most of the squared error comes from texels whose samples' tail is heavy (TailGuard):
  // such an estimate of variance cannot be trusted.
  bool suspicious() const;
  // Radiance, and the largest 95 % half-width of a coefficient's luminance relative to L00's.
  ShRgb harmonics() const;
  double harmonics_error() const;
  const RayCounters& counters() const { return counters_; }

 private:
  struct Texel {
    Vec3d sum;
    double luminance[kReplicates] = {};  // sums
    TailGuard tail;
  };
  struct Block {
    RayCounters counters;
    std::vector<Vec3d> harmonics;  // [replicate * bands^2 + coefficient]
  };

  // What one search for direct light found.
  struct Sighting {
    uint32_t slot = kNowhere;
    DirectLight light;
  };
  static constexpr uint32_t kNowhere = UINT32_MAX;

  float first_density(const Vec3d& direction) const;
  uint32_t slot_of(const Vec3d& direction) const;
  Sighting look(Sight sight, uint64_t replicate, uint32_t index, RayCounters& counters) const;
  void look_directly(Sight sight, uint32_t from, uint32_t to, Progress& progress, double done,
                     RayCounters* counters, std::vector<Vec3d>* harmonics);
  void sample_texel(size_t i, uint32_t from, uint32_t to, Progress& progress, Block* block);

  const RadianceScene& scene_;
  const CubeTexels& order_;
  Vec3 origin_;
  uint64_t key_;
  int bands_;
  int threads_;
  uint64_t replicates_;
  uint32_t taken_ = 0;  // a replicate
  std::vector<Texel> slots_;
  std::vector<uint32_t> slot_by_texel_;  // empty when all texels are asked for
  std::vector<Vec3d> harmonics_;         // by replicate, means over the samples so far
  RayCounters counters_;
};

}  // namespace lightkiln

#pragma once

// Directional lights that stand for a map: their irradiances sum to the integral of its radiance in
// every channel.

#include <span>
#include <vector>

#include "core/environment/light_cells.h"

namespace lightkiln {

struct DirectionalLight {
  Vec3d direction;   // unit, towards the light
  Vec3d irradiance;  // on a surface that faces it
};

// How the map is divided among lights.
enum class LightSplit {
  // Debevec, "A Median Cut Algorithm for Light Probe Sampling", SIGGRAPH 2005 posters: regions of
  // longitude and latitude, halved by energy across their longer side.
  median_cut,
  // Viriyothai and Debevec, "Variance Minimization Light Probe Sampling", SIGGRAPH 2009 posters:
  // the region that gains most is cut where the variance of direction left in its parts is least.
  variance_cut,
  // Those cuts as the start of Lloyd's iteration (k-means on the sphere).
  clusters,
};

// At most `count` >= 1 lights, brightest first; fewer when the map has fewer cells of light, none
// when it is black. Energy is conserved per channel to rounding.
std::vector<DirectionalLight> split_lights(const LightCells& light, int count, LightSplit split,
                                           int threads, Progress& progress);

// Irradiance by the lights, on a surface with the unit normal.
Vec3d light_irradiance(std::span<const DirectionalLight> lights, const Vec3d& normal);

// Relative to the mean luminance of irradiance over all normals, over normals and channels.
struct IrradianceError {
  double rms = 0, max = 0;
};

// Compares light sets with the map at kNormals normals spread over the sphere.
class IrradianceReference {
 public:
  static constexpr int kNormals = 1024;
  IrradianceReference(const LightCells& light, int threads, Progress& progress);
  IrradianceError error(std::span<const DirectionalLight> lights) const;

 private:
  std::vector<Vec3d> normals_, irradiance_;
  double mean_ = 0;
};

}  // namespace lightkiln

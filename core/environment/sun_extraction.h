#pragma once

// Splits an environment into its brightest compact source, told as a disk of uniform radiance, and
// the map without it. What leaves the map is what the disk holds, channel by channel.

#include <cstdint>
#include <string>

#include "core/environment/environment.h"
#include "core/sphere/harmonics.h"

namespace lightkiln {

struct SunOptions {
  // A source that reaches farther from its centre is no sun. Radians, > 0.
  double max_angular_radius_rad = 2.5 * kPi / 180;
  // How many times the luminance at which it was cut off its surroundings the source's brightest
  // texel must have, >= 1.
  double min_contrast = 5;
};

// Uniform radiance over all directions within `angular_radius_rad` of `direction`.
struct SunDisk {
  Vec3d direction;  // unit, from the observer to the source
  double angular_radius_rad = 0;
  Vec3d radiance;

  // The integral of radiance over the disk.
  Vec3d energy() const;
  // On a surface that faces it.
  Vec3d irradiance() const;
};

struct SunExtraction {
  bool found = false;
  std::string reason;  // one sentence, found or not
  SunDisk disk;
  // Integrals of radiance over the sphere, of the map as it was and of what is left of it.
  Vec3d energy_before, energy_after;
  double max_luminance_before = 0;
  double contrast = 0;    // brightest texel over the luminance at which the source was cut off
  double extent_rad = 0;  // from the disk's centre to the farthest texel that gave
  uint64_t texels = 0;    // that gave
};

// Takes the source out of the map, or leaves every byte of it alone and says why.
SunExtraction extract_sun(Environment& environment, const SunOptions& options);

// The disk's radiance coefficients in closed form.
ShRgb sun_harmonics(const SunDisk& disk, int bands);

}  // namespace lightkiln

#pragma once

// Cubes that an environment is convolved into: an irradiance cube and the levels of a prefiltered
// chain are the same work with another lobe, scale and name.

#include <optional>

#include "core/bake/maps_output.h"
#include "core/environment/lobe_averages.h"
#include "core/environment/turned_cube.h"

namespace lightkiln {

// The texels of a cube that are held against a twin.
struct CheckedTexels {
  struct Texel {
    int x, line;  // of the strip of faces
  };
  CheckedTexels(int count, int face_size);
  // Of the texels' middles, turned back.
  std::vector<Vec3d> directions(const Rotation& turn) const;
  // Against `truths` times `factor`, relative to `scale`.
  MeasuredError compare(const Image& cube, const LobeAverages& truths, double factor,
                        double scale) const;

  int face_size;
  std::vector<Texel> texels;
};

class ConvolvedCube : public MapsOutput {
 public:
  // `lobe` none: the map itself, resampled by area. `scale` multiplies the average (pi:
  // irradiance).
  ConvolvedCube(MapsLight& light, int size, std::optional<Lobe> lobe, double scale, double target);

  double error_bound() const override;
  SpectrumNeed spectrum_need() const override;
  double model_seconds(MapsLight& light) const override;
  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override;

 protected:
  int size() const { return size_; }
  Image read(ByteReader& reader) const;

  bool constant() const { return constant_; }
  Image make_cube(MapsLight& light, Progress& progress) const;
  // Relative to the output's mean.
  MeasuredError check(MapsLight& light, const Image& cube, int count, Progress& progress) const;

 private:
  int size_;
  std::optional<Lobe> lobe_;
  double scale_;
  bool constant_;
  LobePlan plan_;  // empty when nothing is convolved
  // Of the map itself on a cube: every texel's, of which the mean square is at most 1 + spread^2.
  double rounding_ = 0;
  std::optional<TurnedCubePlan> turned_;  // where a turn is pending
};

}  // namespace lightkiln

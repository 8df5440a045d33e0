#pragma once

// Draws points on surfaces that shine by themselves: a triangle by its weight, then a point of it,
// uniform where the light is even and by TexturedEmission where it is textured.

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/random.h"
#include "core/trace/light_survey.h"
#include "core/trace/textured_emission.h"
#include "core/trace/tracer.h"

namespace lightkiln {

// A texel this many times as bright as its mesh's mean is a hot spot.
inline constexpr double kHotSpot = 8;

class EmissiveSampler {
 public:
  // Which surfaces shine: those that emit, or those that are unlit, which show their base colour.
  enum class Shining { emissive, unlit };
  // What draws are for. Lighting: shared out by area times luminance, over all that shines. Seeing:
  // half of them by the mean luminance of a mesh alone, so that none is lost beside a large one,
  // and of textures with hot spots (kHotSpot) those alone, since whoever looks sees the rest
  // unaided.
  enum class Purpose { lighting, seeing };

  EmissiveSampler() = default;
  // `textures` false leaves them unread: each mesh shines evenly.
  EmissiveSampler(const Scene& scene, const LightSurvey& survey, Shining shining, Purpose purpose,
                  bool textures);

  bool empty() const { return triangles_.empty(); }

  // A point with its density per normalised area. Its t is 0.
  struct Draw {
    Hit point;
    float area_density = 0;
  };
  Draw sample(const Point4& u) const;

  // Density per normalised area with which sample() finds a point; 0 where nothing shines.
  float area_density(const Hit& hit) const;

 private:
  struct Triangle {
    uint32_t mesh;
    uint32_t triangle;
  };
  // Weights of one mesh's triangles, and the mesh's mean luminance.
  struct Weights {
    std::vector<double> triangles;
    double power = 0;
    double brightness = 0;
  };
  Weights weigh(const Scene& scene, const LightSurvey& survey, uint32_t mesh, Shining shining,
                Purpose purpose, bool textures);

  std::vector<Triangle> triangles_;
  std::vector<double> cdf_;     // one more than triangles, from 0 to 1, strictly increasing
  std::vector<float> density_;  // by mesh, of even light
  std::vector<double> scale_;   // by mesh: density of even points of a triangle over its mean
  std::vector<std::unique_ptr<TexturedEmission>> textured_;  // by mesh; null = even
};

}  // namespace lightkiln

#include "tests/reference/slow_path_tracer.h"

#include <cmath>
#include <random>

namespace lightkiln::reference {

namespace {

struct SlowHit {
  double t = INFINITY;
  Vec3d normal;  // by winding, unit
  const Material* material = nullptr;
};

// Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
SlowHit nearest(const Scene& scene, const Vec3d& o, const Vec3d& d) {
  SlowHit best;
  for (const SurfaceMesh& mesh : scene.meshes) {
    for (const auto& t : mesh.triangles) {
      const Vec3d a = to_double(mesh.positions[t[0]]);
      const Vec3d e1 = to_double(mesh.positions[t[1]]) - a;
      const Vec3d e2 = to_double(mesh.positions[t[2]]) - a;
      const Vec3d p = cross(d, e2);
      const double det = dot(e1, p);
      if (det == 0) continue;
      const Vec3d s = o - a;
      const double u = dot(s, p) / det;
      const Vec3d q = cross(s, e1);
      const double v = dot(d, q) / det, distance = dot(e2, q) / det;
      if (u < 0 || v < 0 || u + v > 1 || distance < 1e-9 || distance >= best.t) continue;
      best = {distance, normalize(cross(e1, e2)),
              &scene.materials[static_cast<size_t>(mesh.material)]};
    }
  }
  return best;
}

}  // namespace

SlowEstimate slow_radiance(const Scene& scene, const Vec3d& sky, const Vec3d& origin,
                           const Vec3d& direction, int bounces, int paths, uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  Vec3d sum, squares;
  for (int path = 0; path < paths; ++path) {
    Vec3d o = origin, d = direction, weight{1, 1, 1}, radiance;
    for (int bounce = 0;; ++bounce) {
      const SlowHit hit = nearest(scene, o, d);
      if (hit.material == nullptr) {
        radiance += weight * sky;
        break;
      }
      const bool front = dot(hit.normal, d) < 0;
      if (front || hit.material->double_sided) {
        radiance += weight * to_double(hit.material->emissive);
      }
      if (bounce == bounces) break;
      weight = weight * to_double(hit.material->base_color);
      const Vec3d n = front ? hit.normal : -hit.normal;
      o = o + d * hit.t;
      const double r2 = uniform(generator), phi = 2 * kPi * uniform(generator);
      const double r = std::sqrt(r2);
      d = normalize(
          make_basis(n).to_world({r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - r2)}));
    }
    sum += radiance;
    squares += radiance * radiance;
  }
  const double n = paths;
  const Vec3d mean = sum / n, variance = squares / n - mean * mean;
  const auto error = [&](double v) { return std::sqrt(std::max(v, 0.0) / n); };
  return {mean, {error(variance.x), error(variance.y), error(variance.z)}};
}

}  // namespace lightkiln::reference

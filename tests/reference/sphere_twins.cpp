#include "tests/reference/sphere_twins.h"

#include <algorithm>
#include <cmath>

#include "core/sphere/direction_map.h"

namespace lightkiln::reference {

namespace {

// Visits cells of texel (x, y): body(direction, solid angle).
template <typename Body>
void visit_cells(const Image& map, int x, int y, int cuts, const Body& body) {
  for (int j = 0; j < cuts; ++j) {
    const double v0 = (y + double(j) / cuts) / map.height;
    const double v1 = (y + (j + 1.0) / cuts) / map.height;
    const double omega = 2 * kPi / map.width / cuts * 2 * std::sin(kPi * (v0 + v1) / 2) *
                         std::sin(kPi * (v1 - v0) / 2);
    for (int i = 0; i < cuts; ++i) {
      body(latlong_direction((x + (i + 0.5) / cuts) / map.width, (v0 + v1) / 2), omega);
    }
  }
}

// Visits four Gauss points of each cell: the error falls with the fourth power of the cell.
template <typename Body>
void visit_points(const Image& map, int x, int y, int cuts, const Body& body) {
  const double place[2] = {0.5 - 0.5 / std::sqrt(3.0), 0.5 + 0.5 / std::sqrt(3.0)};
  for (int j = 0; j < 2 * cuts; ++j) {
    const double v = (y + (j / 2 + place[j % 2]) / cuts) / map.height;
    const double omega =
        2 * kPi / map.width * kPi / map.height * std::sin(kPi * v) / (4.0 * cuts * cuts);
    for (int i = 0; i < 2 * cuts; ++i) {
      body(latlong_direction((x + (i / 2 + place[i % 2]) / cuts) / map.width, v), omega);
    }
  }
}

}  // namespace

ShRgb project(const Image& latlong, int bands, int cuts) {
  ShRgb sh(bands);
  std::vector<double> basis(sh.coefficients.size());
  for (int y = 0; y < latlong.height; ++y) {
    for (int x = 0; x < latlong.width; ++x) {
      const Vec3d radiance = to_double(latlong.rgb(x, y));
      visit_cells(latlong, x, y, cuts, [&](const Vec3d& direction, double omega) {
        sh_evaluate_basis(direction, bands, basis);
        for (size_t k = 0; k < basis.size(); ++k) {
          sh.coefficients[k] += radiance * (basis[k] * omega);
        }
      });
    }
  }
  return sh;
}

double ggx_lobe(double alpha, double cosine) {
  if (cosine <= 0) return 0;
  // n = (0, 0, 1), l = (sin, 0, cos); sin^2 of the half vector from its components, which does not
  // cancel.
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double hx = sine, hz = 1 + cosine;
  const double sin2 = hx * hx / (hx * hx + hz * hz), cos2 = hz * hz / (hx * hx + hz * hz);
  const double denominator = sin2 + cos2 * alpha * alpha;
  return alpha * alpha / (kPi * denominator * denominator) * cosine;
}

Vec3d prefilter(const Image& latlong, double alpha, const Vec3d& axis) {
  Vec3d sum;
  double weight = 0;
  const double texel = kPi / latlong.height;
  for (int y = 0; y < latlong.height; ++y) {
    for (int x = 0; x < latlong.width; ++x) {
      const Vec3d centre = latlong_direction((x + 0.5) / latlong.width, (y + 0.5) / latlong.height);
      const double angle = std::acos(std::clamp(dot(centre, axis), -1.0, 1.0));
      const bool horizon = std::abs(angle - kPi / 2) < texel;
      const double width = std::max(alpha, angle);
      const int cuts =
          horizon ? 8 : std::clamp(static_cast<int>(std::ceil(6 * texel / width)), 1, 24);
      const Vec3d radiance = to_double(latlong.rgb(x, y));
      visit_points(latlong, x, y, cuts, [&](const Vec3d& direction, double omega) {
        const double lobe = ggx_lobe(alpha, dot(direction, axis)) * omega;
        sum += radiance * lobe;
        weight += lobe;
      });
    }
  }
  return sum / weight;
}

Vec3d irradiance(const Image& latlong, const Vec3d& normal) {
  Vec3d sum;
  for (int y = 0; y < latlong.height; ++y) {
    for (int x = 0; x < latlong.width; ++x) {
      const Vec3d radiance = to_double(latlong.rgb(x, y));
      const double above =
          dot(latlong_direction((x + 0.5) / latlong.width, (y + 0.5) / latlong.height), normal);
      const int cuts = std::abs(above) < kPi / latlong.height ? 32 : 4;
      visit_cells(latlong, x, y, cuts, [&](const Vec3d& direction, double omega) {
        sum += radiance * (std::max(0.0, dot(direction, normal)) * omega);
      });
    }
  }
  return sum;
}

Vec3d cube_texel_mean(const Image& latlong, int face, int x, int y, int size, int cuts) {
  Vec3d sum;
  double weight = 0;
  for (int j = 0; j < cuts; ++j) {
    for (int i = 0; i < cuts; ++i) {
      const double s = (x + (i + 0.5) / cuts) / size, t = (y + (j + 0.5) / cuts) / size;
      const double a = 2 * s - 1, b = 2 * t - 1;
      const double omega = std::pow(1 + a * a + b * b, -1.5);
      double u = 0, v = 0;
      latlong_coordinates(cube_direction(face, s, t), &u, &v);
      const int column = std::min(static_cast<int>(u * latlong.width), latlong.width - 1);
      const int row = std::min(static_cast<int>(v * latlong.height), latlong.height - 1);
      sum += to_double(latlong.rgb(column, row)) * omega;
      weight += omega;
    }
  }
  return sum / weight;
}

Dfg dfg(double alpha, double cosine, int steps) {
  // v = (sin, 0, cos). Half vectors by the distribution D(h) n.h: cos^2 = (1-u) / (1 + (a^2-1) u).
  // The integrand is then 4 V (n.l) (v.h) / (n.h) with the height-correlated Smith visibility V.
  const double a2 = alpha * alpha;
  const Vec3d v{std::sqrt(1 - cosine * cosine), 0, cosine};
  Dfg sum;
  for (int i = 0; i < steps; ++i) {
    const double u = (i + 0.5) / steps;
    const double hz = std::sqrt((1 - u) / (1 + (a2 - 1) * u));
    const double hr = std::sqrt(std::max(0.0, 1 - hz * hz));
    for (int j = 0; j < steps; ++j) {
      const double phi = kPi * (j + 0.5) / steps;
      const Vec3d h{hr * std::cos(phi), hr * std::sin(phi), hz};
      const double vh = dot(v, h), nl = 2 * vh * h.z - v.z;
      if (vh <= 0 || nl <= 0) continue;
      const double visibility = 0.5 / (nl * std::sqrt(cosine * cosine * (1 - a2) + a2) +
                                       cosine * std::sqrt(nl * nl * (1 - a2) + a2));
      const double value = 4 * visibility * nl * vh / h.z;
      const double fresnel = std::pow(1 - vh, 5);
      sum.scale += (1 - fresnel) * value;
      sum.bias += fresnel * value;
    }
  }
  const double count = double(steps) * steps;
  return {sum.scale / count, sum.bias / count};
}

Image test_sky(int height, double sun_radiance) {
  Image sky(2 * height, height, 3);
  const Vec3d sun = normalize(Vec3d{0.5, 0.4, -0.7});
  const double reach = std::cos(std::max(0.01, 0.8 * kPi / height));  // at least one texel
  uint32_t state = 1;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < sky.width; ++x) {
      const Vec3d d = latlong_direction((x + 0.5) / sky.width, (y + 0.5) / height);
      state = state * 1664525u + 1013904223u;
      const double noise = 0.1 * (state >> 8) * 0x1p-24;
      float* p = sky.at(x, y);
      p[0] = static_cast<float>(0.5 + 0.4 * d.y + 0.2 * d.x + noise);
      p[1] = static_cast<float>(0.6 + 0.3 * d.y * d.z + noise);
      p[2] = static_cast<float>(d.y > 0 ? 1.2 + noise : 0.1 + noise);
      if (dot(d, sun) > reach) {
        for (int c = 0; c < 3; ++c) p[c] = static_cast<float>(sun_radiance * (1 - 0.1 * c));
      }
    }
  }
  return sky;
}

}  // namespace lightkiln::reference

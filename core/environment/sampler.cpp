// A texel is its exact spherical rectangle: equal steps of longitude times equal steps of cos
// theta have equal solid angle, so a point uniform in (phi, cos theta) inside it is uniform on the
// sphere and the density needs no division by sin theta, poles included.

#include "core/environment/sampler.h"

#include <algorithm>

#include "core/base/pinned_math.h"
#include "core/sphere/direction_map.h"
#include "core/sphere/solid_angle.h"

namespace lightkiln {

namespace {

// The last index i with cdf[i] <= value whose interval is not empty.
int find_interval(const double* cdf, int count, double value) {
  const double* found = std::upper_bound(cdf, cdf + count + 1, value);
  int index = std::clamp(static_cast<int>(found - cdf) - 1, 0, count - 1);
  // Rounding may select an empty interval at either end of a run of zeros.
  while (index > 0 && cdf[index + 1] <= cdf[index]) --index;
  while (index + 1 < count && cdf[index + 1] <= cdf[index]) ++index;
  return index;
}

// Prefix sums in double, divided by the total; the last entry is exactly 1.
double normalised_prefix(const double* weights, int count, double* cdf) {
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    cdf[i] = sum;
    sum += weights[i];
  }
  cdf[count] = sum;
  if (sum > 0) {
    for (int i = 0; i <= count; ++i) cdf[i] /= sum;
  }
  return sum;
}

}  // namespace

EnvironmentSampler::EnvironmentSampler(const Environment& environment, double floor)
    : environment_(&environment) {
  const Image& image = environment.radiance;
  const size_t width = static_cast<size_t>(image.width), height = static_cast<size_t>(image.height);
  row_cdf_.resize(height + 1);
  texel_cdf_.resize(height * (width + 1));
  std::vector<double> weights(width), rows(height);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      weights[static_cast<size_t>(x)] =
          std::max(0.0, luminance(to_double(image.rgb(x, y))) - floor);
    }
    rows[static_cast<size_t>(y)] =
        normalised_prefix(weights.data(), image.width,
                          &texel_cdf_[static_cast<size_t>(y) * (width + 1)]) *
        latlong_texel_solid_angle(y, image.width, image.height);
  }
  const double total = normalised_prefix(rows.data(), image.height, row_cdf_.data());
  black_ = !(total > 0) || !std::isfinite(total);
}

double EnvironmentSampler::texel_pdf(int x, int y) const {
  const Image& image = environment_->radiance;
  const size_t row = static_cast<size_t>(y);
  const double* texels = &texel_cdf_[row * (static_cast<size_t>(image.width) + 1)];
  const double probability = (row_cdf_[row + 1] - row_cdf_[row]) * (texels[x + 1] - texels[x]);
  return probability / latlong_texel_solid_angle(y, image.width, image.height);
}

EnvironmentSampler::Sample EnvironmentSampler::sample(float u, float v) const {
  const Image& image = environment_->radiance;
  if (black_) {
    const double cosine = 1 - 2 * static_cast<double>(v);
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const SinCos around = pinned_sin_cos(2 * kPi * static_cast<double>(u));
    return {to_float(Vec3d{sine * around.sin, cosine, sine * around.cos}), Vec3{},
            static_cast<float>(1 / (4 * kPi))};
  }
  const int y = find_interval(row_cdf_.data(), image.height, v);
  const size_t row = static_cast<size_t>(y);
  const double* texels = &texel_cdf_[row * (static_cast<size_t>(image.width) + 1)];
  const int x = find_interval(texels, image.width, u);

  // The rest of each number places the point inside the texel, kept off its borders by less than
  // a float can tell so that the direction belongs to this texel.
  const auto inside = [](double value, double low, double high) {
    return std::clamp((value - low) / (high - low), 1e-4, 1 - 1e-4);
  };
  const double fy = inside(v, row_cdf_[row], row_cdf_[row + 1]);
  const double fx = inside(u, texels[x], texels[x + 1]);
  // cos t0 - f (cos t0 - cos t1) without cancellation: from 1 - cos t = 2 sin^2(t/2) on the side
  // of the nearer pole.
  const double top = kPi * y / image.height, bottom = kPi * (y + 1) / image.height;
  const bool south = 2 * y >= image.height;
  const double near_pole = south ? kPi - top : top, far_pole = south ? kPi - bottom : bottom;
  const auto versine_half = [](double angle) {
    const double s = pinned_sin_cos(angle / 2).sin;
    return s * s;
  };
  const double half = versine_half(near_pole) * (1 - fy) + versine_half(far_pole) * fy;
  const double sine = 2 * std::sqrt(half * (1 - half));
  const double cosine = (south ? -1 : 1) * (1 - 2 * half);
  const SinCos around = pinned_sin_cos(kPi * (1 - 2 * (x + fx) / image.width));
  const Vec3d direction{sine * around.sin, cosine, sine * around.cos};
  return {to_float(direction), image.rgb(x, y), static_cast<float>(texel_pdf(x, y))};
}

float EnvironmentSampler::pdf(const Vec3& direction) const {
  if (black_) return static_cast<float>(1 / (4 * kPi));
  const Image& image = environment_->radiance;
  double u = 0, v = 0;
  latlong_coordinates(to_double(direction), &u, &v);
  const int x = std::min(static_cast<int>(u * image.width), image.width - 1);
  const int y = std::min(static_cast<int>(v * image.height), image.height - 1);
  return static_cast<float>(texel_pdf(x, y));
}

// Karlik, Sik, Vevoda, Skrivan and Krivanek, "MIS Compensation: Optimizing Sampling Techniques in
// Multiple Importance Sampling", SIGGRAPH Asia 2019: two techniques with half of the samples each
// have the least variance where (p + q) / 2 is proportional to the integrand, so that the free one
// is p = max(0, 2 b f / F - q), with b such that it integrates to 1. The other follows the surface,
// whose directions are not known here: over all of them it is uniform, q = 1 / 4pi, and with
// f / F = L / (4pi m), m the mean luminance,
//   p = max(0, L - t) / (4pi t),  t = m / 2b,  where  mean max(0, L - t) = t.
// The left side minus the right is convex and falls in t: Newton's steps from 0 rise to the root.
double mis_compensation_floor(const Environment& environment) {
  const Image& image = environment.radiance;
  double floor = 0;
  for (int round = 0; round < 64; ++round) {
    double over = 0, share = 0;  // mean excess; part of the sphere that exceeds
    for (int y = 0; y < image.height; ++y) {
      double excess = 0;
      int count = 0;
      for (int x = 0; x < image.width; ++x) {
        const double l = luminance(to_double(image.rgb(x, y)));
        if (l <= floor) continue;
        excess += l - floor;
        ++count;
      }
      const double weight = latlong_texel_solid_angle(y, image.width, image.height) / (4 * kPi);
      over += excess * weight;
      share += count * weight;
    }
    const double next = floor + (over - floor) / (share + 1);
    if (!(next > floor)) break;
    const bool settled = next - floor < 1e-12 * next;
    floor = next;
    if (settled) break;
  }
  return floor;
}

}  // namespace lightkiln

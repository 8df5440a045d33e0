// Openness against closed forms: scenes whose answer is a formula.
// Tags beside tests are explained in tests/support/hard_cases.h.

#include "core/bake/openness.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/statistics.h"
#include "tests/support/gltf_builder.h"

namespace lightkiln {
namespace {

using test::make_quad;
using test::make_sphere;
using test::merged;
using test::MeshData;

// World units throughout; the scene's own normalisation is applied here.
struct Place {
  Vec3d position;
  Vec3d normal{0, 1, 0};
};

std::vector<OpennessEstimate> openness_at(const MeshData& mesh, const std::vector<Place>& places,
                                          OpennessParameters parameters) {
  const Scene scene = test::scene_from_triangles(mesh);
  const Tracer tracer(scene, {});
  parameters.max_distance *= scene.normalisation.scale();
  parameters.falloff_distance *= scene.normalisation.scale();
  const OpennessKernel kernel(tracer, parameters);
  std::vector<Facet> facets;
  for (const Place& place : places) {
    SurfacePoint point;
    point.position = to_float(scene.normalisation.to_normalised(place.position));
    point.normal = to_float(place.normal);
    point.error = {5e-7f, 5e-7f, 5e-7f};
    facets.push_back({offset_origin(point, point.normal), point.normal, 1});
  }
  std::vector<OpennessElement> elements;
  for (size_t i = 0; i < places.size(); ++i)
    elements.push_back({i, std::span(facets).subspan(i, 1)});
  std::vector<OpennessEstimate> estimates(places.size());
  ChunkReport report;
  kernel.estimate(elements, estimates, &report, Progress());
  EXPECT_EQ(report.counters.rejected_rays, 0u);
  return estimates;
}

// 65536 samples, no early stop.
OpennessParameters thorough() {
  OpennessParameters p;
  p.target_error = 0;
  p.max_samples = 65536;
  return p;
}

double openness_of(const MeshData& mesh, const Place& place,
                   const OpennessParameters& p = thorough()) {
  return openness_at(mesh, {place}, p)[0].openness;
}

constexpr double kTolerance = 1e-3;
constexpr float kFar = 1e4f;  // stands for infinity: shifts an answer by 1e-4 at the most

MeshData floor_plane(float half = kFar) {
  return test::make_floor(half);
}

// The rectangle z in [-half, half], y in [0, height] of the plane x = a.
MeshData wall(float a, float half, float height) {
  return make_quad({a, 0, -half}, {0, 0, 2 * half}, {0, height, 0});
}

MeshData ceiling(float height) {
  return make_quad({-100, height, -100}, {200, 0, 0}, {0, 0, 200});
}

TEST(Openness, FloorBesideALongWallOfFiniteHeight) {  // A2
  for (const double a : {0.25, 1.0, 4.0}) {
    const MeshData scene = merged(floor_plane(100), wall(static_cast<float>(a), 2000, 1));
    EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}), 0.5 * (1 + a / std::sqrt(a * a + 1)), kTolerance)
        << a;
  }
}

TEST(Openness, PlanesMeetingAtAnAngle) {  // A3
  for (const double degrees : {45.0, 90.0, 135.0}) {
    const double theta = degrees * kPi / 180;
    const Vec3 along = to_float({std::cos(theta), std::sin(theta), 0});
    const MeshData scene =
        merged(floor_plane(), make_quad({0, 0, -kFar}, {0, 0, 2 * kFar}, along * kFar));
    EXPECT_NEAR(openness_of(scene, {{1, 0, 0}}), std::pow(std::sin(theta / 2), 2), kTolerance)
        << degrees;
  }
}

TEST(Openness, CornerOfTwoWallsSeesAQuarter) {  // A3
  MeshData scene = merged(floor_plane(), wall(1, kFar, kFar));
  scene = merged(scene, make_quad({-kFar, 0, 1}, {2 * kFar, 0, 0}, {0, kFar, 0}));
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}), 0.25, kTolerance);
}

TEST(Openness, MiddleOfATrench) {  // A4
  const MeshData scene = merged(merged(floor_plane(100), wall(1, 2000, 2)), wall(-1, 2000, 2));
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}), 1 / std::sqrt(5.0), kTolerance);
}

// An open cylinder about +Y, y in [0, height], many-sided; the circumradius makes the
// cross-section's area that of the circle.
MeshData tube(double radius, double height, int sides = 512) {
  const double step = 2 * kPi / sides;
  const double r = radius * std::sqrt(step / std::sin(step));
  MeshData mesh;
  for (int i = 0; i < sides; ++i) {
    const auto at = [&](int k) {
      return to_float({r * std::cos(step * k), 0, r * std::sin(step * k)});
    };
    mesh = merged(mesh, make_quad(at(i), at(i + 1) - at(i), {0, static_cast<float>(height), 0}));
  }
  return mesh;
}

TEST(Openness, FloorOfACylinderPit) {  // A5, A6
  const double R = 1, H = 1.5;
  const MeshData scene = merged(floor_plane(10), tube(R, H));
  for (const double r : {0.0, 0.4, 0.8}) {
    const double s = H * H + r * r + R * R;
    const double expected =
        0.5 * (1 - (H * H + r * r - R * R) / std::sqrt(s * s - 4 * r * r * R * R));
    EXPECT_NEAR(openness_of(scene, {{r, 0, 0}}), expected, kTolerance) << r;
  }
}

TEST(Openness, FloorOfAUnitCubePit) {  // A7, and A1's closed box
  const MeshData cube = test::make_box({-0.5f, 0, -0.5f}, {0.5f, 1, 0.5f});
  MeshData pit = cube;
  std::erase_if(pit.triangles, [&](const auto& t) {
    return pit.positions[t[0]].y == 1 && pit.positions[t[1]].y == 1 && pit.positions[t[2]].y == 1;
  });
  ASSERT_EQ(pit.triangles.size(), 10u);
  EXPECT_NEAR(openness_of(pit, {{0, 0, 0}}), 0.239456, kTolerance);
  EXPECT_EQ(openness_of(cube, {{0, 0, 0}}), 0.0);
}

TEST(Openness, FloorBesideAFiniteWall) {  // A8
  const double a = 1, b = 0.7, c = 1.3;
  const double k = std::sqrt(a * a + c * c);
  const double half_occlusion = (std::atan(b / a) - a / k * std::atan(b / k)) / (2 * kPi);
  const MeshData scene = merged(floor_plane(10), wall(1, 0.7f, 1.3f));
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}), 1 - 2 * half_occlusion, kTolerance);
}

TEST(Openness, SphereAboveTheHorizon) {  // A9
  const double R = 0.5, d = 2, theta = 0.6;
  const Vec3d centre{d * std::sin(theta), d * std::cos(theta), 0};
  const MeshData scene =
      merged(floor_plane(10), make_sphere(to_float(centre), static_cast<float>(R), 128, 256));
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}), 1 - std::cos(theta) * R * R / (d * d), kTolerance);
}

TEST(Openness, SphereRestingOnTheFloor) {  // A10
  const MeshData scene = merged(floor_plane(10), make_sphere({0, 1, 0}, 1, 128, 256));
  EXPECT_NEAR(openness_of(scene, {{1, 0, 0}}), 0.646447, kTolerance);
  EXPECT_NEAR(openness_of(scene, {{2, 0, 0}}), 0.910557, kTolerance);
}

// A unit sphere seen from inside, open above one ring of its tessellation.
MeshData bowl(double* open_share) {
  constexpr int kRings = 180;
  MeshData mesh = test::reversed(make_sphere({0, 0, 0}, 1, kRings, 360));
  const double top = std::cos(kPi * 60 / kRings);
  std::erase_if(mesh.triangles, [&](const auto& t) {
    double y = 0;
    for (const uint32_t corner : t) y += static_cast<double>(mesh.positions[corner].y) / 3;
    return y > top;
  });
  *open_share = (1 - top) / 2;
  return mesh;
}

TEST(Openness, IsTheOpenShareAnywhereInABowl) {  // A11
  double share = 0;
  const MeshData mesh = bowl(&share);
  for (const double polar : {0.5 * kPi, 0.75 * kPi, kPi}) {
    const Vec3d n{std::sin(polar), std::cos(polar), 0};
    // Just inside the polygonal wall.
    EXPECT_NEAR(openness_of(mesh, {n * 0.9995, -n}), share, kTolerance) << polar;
  }
}

TEST(Openness, CeilingWithinReach) {  // A12, A13
  const double h = 0.6, D = 1;
  const double c = h / D;
  const MeshData scene = merged(floor_plane(100), ceiling(0.6f));
  OpennessParameters p = thorough();
  p.max_distance = D;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), c * c, kTolerance);
  p.falloff = Falloff::linear;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), 1 - (1 - c) * (1 - c), kTolerance);
  p.falloff = Falloff::quadratic;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), c * c * (1 - 2 * std::log(c)), kTolerance);
  // With t = c / x, x the cosine: c^2 + 2 int_c^1 (3 c^2 / x^2 - 2 c^3 / x^3) x dx.
  p.falloff = Falloff::smooth;
  const double smooth = c * c + 2 * (-3 * c * c * std::log(c) - 2 * c * c * c * (1 / c - 1));
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), smooth, kTolerance);
}

TEST(Openness, ExponentialFalloffUnderACeiling) {
  // 1 - int_0^1 2 x e^(-h / (f x)) dx by a fine midpoint rule, infinite reach.
  const double h = 0.6, f = 0.8;
  double expected = 1;
  constexpr int kSteps = 200000;
  for (int i = 0; i < kSteps; ++i) {
    const double x = (i + 0.5) / kSteps;
    expected -= 2 * x * std::exp(-h / (f * x)) / kSteps;
  }
  OpennessParameters p = thorough();
  p.falloff = Falloff::exponential;
  p.falloff_distance = f;
  EXPECT_NEAR(openness_of(merged(floor_plane(100), ceiling(0.6f)), {{0, 0, 0}}, p), expected,
              kTolerance);
}

TEST(Openness, ExponentialFalloffWithAFiniteReach) {
  // A ceiling at h is seen within the reach D by cosines x above c = h / D:
  //   1 - int_c^1 2 x e^(-h / (f x)) dx, by a fine midpoint rule.
  const double h = 0.6, f = 0.8, D = 1;
  double expected = 1;
  constexpr int kSteps = 200000;
  for (int i = 0; i < kSteps; ++i) {
    const double x = h / D + (1 - h / D) * (i + 0.5) / kSteps;
    expected -= 2 * x * std::exp(-h / (f * x)) * (1 - h / D) / kSteps;
  }
  OpennessParameters p = thorough();
  p.falloff = Falloff::exponential;
  p.falloff_distance = f;
  p.max_distance = D;
  const MeshData scene = merged(floor_plane(100), ceiling(0.6f));
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), expected, kTolerance);
  p.max_distance = INFINITY;
  EXPECT_LT(openness_of(scene, {{0, 0, 0}}, p), expected - 0.05);  // the reach matters here
}

TEST(Openness, UniformDistributionWithAFalloffUnderACeiling) {
  // Uniform directions have uniform cosines x. Hits lie at d = h / x, for x from c = h / D to 1:
  //   linear     c + int_c^1 c / x dx = c (1 - ln c)
  //   quadratic  c + int_c^1 c^2 / x^2 dx = c + c^2 (1 / c - 1) = c (2 - c)
  const double c = 0.6;
  OpennessParameters p = thorough();
  p.distribution = Distribution::uniform;
  p.max_distance = 1;
  const MeshData scene = merged(floor_plane(100), ceiling(0.6f));
  p.falloff = Falloff::linear;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), c * (1 - std::log(c)), kTolerance);
  p.falloff = Falloff::quadratic;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), c * (2 - c), kTolerance);
}

TEST(Openness, WallWithinReach) {  // A14, A15
  const double a = 0.5, D = 1;
  const double psi = std::acos(a / D);
  const MeshData scene = merged(floor_plane(20), wall(0.5f, 20, 20));
  OpennessParameters p = thorough();
  p.max_distance = D;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), 1 - (psi - std::sin(psi) * std::cos(psi)) / kPi,
              kTolerance);
  p.falloff = Falloff::linear;
  const double expected = 1 - (psi + std::sin(psi) * std::cos(psi) -
                               2 * std::cos(psi) * std::log((1 + std::sin(psi)) / std::cos(psi))) /
                                  kPi;
  EXPECT_NEAR(openness_of(scene, {{0, 0, 0}}, p), expected, kTolerance);
}

TEST(Openness, UniformDistributionAveragesOverSolidAngle) {
  // A wall covers half the hemisphere; a sphere of half-angle t overhead covers 1 - cos(t) of it.
  OpennessParameters p = thorough();
  p.distribution = Distribution::uniform;
  const MeshData wall_scene = merged(floor_plane(), wall(1, kFar, kFar));
  EXPECT_NEAR(openness_of(wall_scene, {{0, 0, 0}}, p), 0.5, kTolerance);
  const MeshData sphere = merged(floor_plane(10), make_sphere({0, 2, 0}, 1, 128, 256));
  EXPECT_NEAR(openness_of(sphere, {{0, 0, 0}}, p), std::cos(std::asin(0.5)), kTolerance);
}

// Why facets look out about their own normals: just inside a face of a coarse sphere, about the
// smooth normal of its corner, some rays start into the solid, and the surface darkens although
// nothing stands above it.
TEST(Openness, AboutShadingNormalsAConvexSolidWouldDarken) {  // G10, positive control
  const MeshData sphere = make_sphere({0, 0, 0}, 1, 8, 16);
  double least = 1;
  for (size_t i = 0; i < sphere.triangles.size(); i += 17) {
    const auto& t = sphere.triangles[i];
    const Vec3d p = to_double(sphere.positions[t[0]]);
    const Vec3d a = to_double(sphere.positions[t[1]]), b = to_double(sphere.positions[t[2]]);
    const Place place{p * 0.98 + a * 0.01 + b * 0.01, to_double(sphere.normals[t[0]])};
    least = std::min(least, openness_of(sphere, place));
  }
  EXPECT_LT(least, 0.995);
}

TEST(Openness, ErrorBarsCoverTheTruth) {  // T3
  // Floor points about a resting sphere: x = 1.2 to 3.2 R, each with its own truth and stream.
  const MeshData scene = merged(floor_plane(10), make_sphere({0, 1, 0}, 1, 192, 384));
  std::vector<Place> places;
  std::vector<double> truths;
  for (int i = 0; i < 2000; ++i) {
    const double x = 1.2 + 0.001 * i;
    const double azimuth = 0.61803398875 * 2 * kPi * i;
    places.push_back({{x * std::sin(azimuth), 0, x * std::cos(azimuth)}});
    truths.push_back(1 - std::pow(1 / (1 + x * x), 1.5));
  }
  const auto share_covered = [&](const OpennessParameters& p) {
    const auto estimates = openness_at(scene, places, p);
    int covered = 0;
    for (size_t i = 0; i < places.size(); ++i)
      covered += std::abs(estimates[i].openness - truths[i]) <= estimates[i].half_width;
    return covered / static_cast<double>(places.size());
  };
  OpennessParameters p;
  p.target_error = 0;
  p.max_samples = 1024;
  const double fixed = share_covered(p);
  EXPECT_GE(fixed, 0.93);
  EXPECT_LE(fixed, 0.97);
  // Stopping by the data spends its alpha, so that bars still cover.
  p.target_error = 0.02;
  p.max_samples = 65536;
  const double adaptive = share_covered(p);
  EXPECT_GE(adaptive, 0.93);
  EXPECT_LE(adaptive, 0.97);
  RecordProperty("fixed", std::to_string(fixed));
  RecordProperty("adaptive", std::to_string(adaptive));
}

TEST(Openness, CertificatesChangeNoValueAndSaveRays) {
  // A grid of places on a floor with one wall: most see nothing within reach.
  std::vector<Place> places;
  for (int i = 0; i < 400; ++i) places.push_back({{-5 + 0.5 * (i % 20), 0, -5 + 0.5 * (i / 20)}});
  OpennessParameters p = thorough();
  p.max_samples = 4096;
  p.max_distance = 0.75;
  const MeshData scene = merged(floor_plane(10), wall(1.1f, 5, 2));
  const auto with = openness_at(scene, places, p);
  p.certificates = false;
  const auto without = openness_at(scene, places, p);
  int certified = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(with[i].openness, without[i].openness);
    if (with[i].status != AccuracyStatus::exact) continue;
    ++certified;
    EXPECT_EQ(with[i].samples, 0u);
    EXPECT_EQ(with[i].half_width, 0);
    // None within reach of the wall.
    EXPECT_GT(std::abs(places[i].position.x - 1.1), 0.75);
  }
  EXPECT_GT(certified, 300);
  EXPECT_LT(certified, 400);
}

TEST(Openness, NeighboursDoNotShareNoise) {  // S6
  const MeshData scene = merged(floor_plane(10), make_sphere({0, 1, 0}, 1, 96, 192));
  const std::vector<Place> places(2000, Place{{1.6, 0, 0.3}});
  OpennessParameters p;
  p.target_error = 0;
  p.max_samples = 256;
  const auto estimates = openness_at(scene, places, p);
  RunningMoments all;
  for (const OpennessEstimate& e : estimates) all.add(e.openness);
  double products = 0;
  for (size_t i = 0; i + 1 < estimates.size(); i += 2)
    products += (estimates[i].openness - all.mean) * (estimates[i + 1].openness - all.mean);
  EXPECT_GT(all.variance(), 0);
  EXPECT_LE(std::abs(products / 1000 / all.variance()), 0.13);
}

TEST(Openness, ErrorFallsFasterThanPlainSampling) {
  const MeshData scene = merged(floor_plane(10), make_sphere({0, 1, 0}, 1, 192, 384));
  std::vector<Place> places;
  std::vector<double> truths;
  for (int i = 0; i < 400; ++i) {
    const double x = 1.2 + 0.005 * i;
    const double azimuth = 0.61803398875 * 2 * kPi * i;
    places.push_back({{x * std::sin(azimuth), 0, x * std::cos(azimuth)}});
    truths.push_back(1 - std::pow(1 / (1 + x * x), 1.5));
  }
  const auto rmse = [&](uint64_t samples) {
    OpennessParameters p;
    p.target_error = 0;
    p.max_samples = samples;
    const auto estimates = openness_at(scene, places, p);
    double sum = 0;
    for (size_t i = 0; i < places.size(); ++i)
      sum += std::pow(estimates[i].openness - truths[i], 2);
    return std::sqrt(sum / static_cast<double>(places.size()));
  };
  const double slope = std::log2(rmse(8192) / rmse(512)) / 4;
  EXPECT_NEAR(slope, -0.72, 0.12);
}

}  // namespace
}  // namespace lightkiln

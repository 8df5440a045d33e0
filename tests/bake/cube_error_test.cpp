#include "core/bake/cube_error.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/math.h"
#include "core/base/random.h"

namespace lightkiln {
namespace {

// Independent standard normals by Box and Muller.
class Normals {
 public:
  explicit Normals(uint64_t seed) : seed_(seed) {}
  double next() {
    const double u = (static_cast<double>(hash_combine(seed_, ++count_) >> 11) + 0.5) * 0x1p-53;
    const double v = static_cast<double>(hash_combine(seed_, ++count_) >> 11) * 0x1p-53;
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
  }

 private:
  uint64_t seed_, count_ = 0;
};

// Texels whose replicates' errors are normal: texel i has deviation scales[i], of which the part
// `common` is shared by all.
struct Cube {
  std::vector<double> scales;
  double common = 0;

  double share() const { return 1 / static_cast<double>(scales.size()); }
  // One more set of replicates: errors[i * kReplicates + r].
  std::vector<double> draw(Normals& normals) const {
    std::vector<double> errors(scales.size() * kReplicates);
    for (size_t r = 0; r < kReplicates; ++r) {
      const double shared = normals.next();
      for (size_t i = 0; i < scales.size(); ++i) {
        errors[i * kReplicates + r] =
            scales[i] * (std::sqrt(common) * shared + std::sqrt(1 - common) * normals.next());
      }
    }
    return errors;
  }
  CubeError estimate(const std::vector<double>& errors) const {
    CubeErrorSum sum;
    for (size_t i = 0; i < scales.size(); ++i) sum.add(&errors[i * kReplicates], share());
    return sum.result();
  }
  // The root mean square over texels of the true errors of the means.
  double truth(const std::vector<double>& errors) const {
    double sum = 0;
    for (size_t i = 0; i < scales.size(); ++i) {
      double mean = 0;
      for (size_t r = 0; r < kReplicates; ++r) mean += errors[i * kReplicates + r] / kReplicates;
      sum += share() * mean * mean;
    }
    return std::sqrt(sum);
  }
};

std::vector<Cube> cubes() {
  std::vector<Cube> all = {{{1}}, {{1, 1}}, {{1, 1, 1, 1, 1, 1}}, {std::vector<double>(100, 1)}};
  all.push_back({{10, 1, 1, 1, 1, 1, 1, 1}});        // one texel holds nearly all
  all.push_back({std::vector<double>(40, 1), 0.5});  // half of the error is common
  Cube rim{std::vector<double>(96, 0.2)};            // few noisy texels among many quiet ones
  for (size_t i = 0; i < 8; ++i) rim.scales[12 * i] = 4;
  all.push_back(rim);
  return all;
}

double covered(const Cube& cube, size_t runs, uint64_t seed) {
  Normals normals(seed);
  size_t inside = 0;
  for (size_t run = 0; run < runs; ++run) {
    const std::vector<double> errors = cube.draw(normals);
    inside += cube.truth(errors) <= cube.estimate(errors).bound(0.95);
  }
  return static_cast<double>(inside) / static_cast<double>(runs);
}

// 95 % bounds hold 93 to 97 times in a hundred, whether one texel errs or a hundred, alike or not,
// together or each for itself.
TEST(CubeError, BoundsCoverTheTruthAsOftenAsTheySay) {
  uint64_t seed = 1;
  for (const Cube& cube : cubes()) {
    const double share = covered(cube, 2000, ++seed);
    EXPECT_GE(share, 0.93) << cube.scales.size() << " texels, common " << cube.common;
    EXPECT_LE(share, 0.975) << cube.scales.size() << " texels, common " << cube.common;
  }
}

// One texel: the root of F is Student's t.
TEST(CubeError, OneTexelIsAnOrdinaryConfidenceInterval) {
  const Cube one{{1}};
  Normals normals(3);
  const std::vector<double> errors = one.draw(normals);
  CubeError error = one.estimate(errors);
  error.effective_texels = 1;
  EXPECT_NEAR(error.bound(0.95), replicate_half_width(errors), 1e-9);
}

TEST(CubeError, EffectiveTexelsCountWhatErrsIndependently) {
  const auto mean_of = [](const Cube& cube) {
    Normals normals(11);
    double sum = 0;
    for (int run = 0; run < 200; ++run) {
      sum += 1 / cube.estimate(cube.draw(normals)).effective_texels / 200;
    }
    return 1 / sum;
  };
  EXPECT_NEAR(mean_of({std::vector<double>(20, 1)}), 20, 3);
  // 8 texels of variance 16 and 88 of 0.04: (128 + 3.52)^2 / (8 * 256 + 88 * 0.0016).
  Cube rim{std::vector<double>(96, 0.2)};
  for (size_t i = 0; i < 8; ++i) rim.scales[12 * i] = 4;
  EXPECT_NEAR(mean_of(rim), 8.4, 1);
  // Errors that all share count as one texel, where plain sums of squares would say 40. Estimates
  // under 1 count as 1, which leaves the noise above it.
  EXPECT_LT(mean_of({std::vector<double>(40, 1), 1}), 1.3);
}

// Stopping at the first doubling whose bound is within the order, on the data that the bound is
// made of: the order is kept in at least 95 % of runs, and the bound told at the end holds 93 to 97
// times in a hundred or more often. Sixteen replicates seldom claim half of what they have, and a
// doubling that overshoots the order leaves slack. Control: a bound that takes itself for better
// than it is does not hold.
TEST(CubeError, LookingAtDoublingsKeepsTheOrder) {
  struct Kept {
    double order = 0, bound = 0;
  };
  const auto run_rule = [](const Cube& cube, double target, double trust) {
    constexpr size_t kRuns = 1000;
    Normals normals(21);
    Kept kept;
    for (size_t run = 0; run < kRuns; ++run) {
      std::vector<double> sums = cube.draw(normals), means = sums;
      double count = 1, bound = 0;
      for (int look = 1;; ++look) {
        bound = trust * cube.estimate(means).bound(kLookConfidence);
        if (bound <= target || look == 12) break;
        // Twice the samples: the sum of as many new errors of independent noise.
        const std::vector<double> fresh = cube.draw(normals);
        for (size_t i = 0; i < sums.size(); ++i) {
          sums[i] += std::sqrt(count) * fresh[i];
          means[i] = sums[i] / (2 * count);
        }
        count *= 2;
      }
      kept.order += cube.truth(means) <= target ? 1.0 / kRuns : 0;
      kept.bound += cube.truth(means) <= bound ? 1.0 / kRuns : 0;
    }
    return kept;
  };
  for (const Cube& cube : cubes()) {
    double scale = 0;
    for (const double s : cube.scales) scale += s * s * cube.share() / kReplicates;
    for (const double target : {0.95, 1.3, 1.9}) {
      const Kept kept = run_rule(cube, target * std::sqrt(scale), 1);
      EXPECT_GE(kept.order, 0.95) << cube.scales.size() << " " << target;
      EXPECT_GE(kept.bound, 0.93) << cube.scales.size() << " " << target;
    }
  }
  EXPECT_LT(run_rule({{1}}, 0.25, 0.6).bound, 0.9);
}

// Many texels tell their error so well that the bound is the error; one needs Student's margin.
TEST(CubeError, ManyTexelsNeedNoMargin) {
  EXPECT_LT((CubeError{1, 4000}.bound(0.95)), 1.03);
  EXPECT_NEAR((CubeError{1, 1}.bound(0.95)), 2.1314, 1e-3);
  EXPECT_EQ((CubeError{0, 5}.bound(0.95)), 0);
}

}  // namespace
}  // namespace lightkiln

// Windows of a probe's coefficients.

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/bake/window_report.h"
#include "tests/bake/maps_orders.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/lit_scene.h"

namespace lightkiln::test {
namespace {

const std::string kScene = "sha256:" + std::string(64, 'b');

// A box under a sky with a sun, one probe above it and one inside.
struct Job {
  std::vector<std::byte> glb = make_glb(make_box({-1, -1, -1}, {1, 1, 1}), grey(0.5f));
  std::vector<std::byte> sky = exr_of(reference::test_sky(16, 2000));
  Spec spec;

  explicit Job(const ProbeShOutput& sh) {
    ProbesParameters parameters;
    parameters.positions = {{0, 3, 0}, {0, 0, 0}};
    parameters.cubemap.size = 4;
    parameters.sh = sh;
    spec.parameters = parameters;
    spec.scene = InputRef{kScene, {}};
    spec.environment = InputRef{kDigest, {}};
    spec.accuracy.target_error = 0.3;
  }
  Assembly bake(int threads = 1) const {
    Inputs inputs;
    inputs.blobs[kScene] = glb;
    inputs.blobs[kDigest] = sky;
    Progress progress;
    return bake_all(spec, inputs, {threads, 0, 4}, progress);
  }
};

const std::vector<ProbeDocument>& probes_of(const Assembly& assembly) {
  return std::get<ProbesDocument>(assembly.document).probes;
}

TEST(ProbesWindow, BringsNothingThatIsNotOrdered) {
  const Assembly result = Job({5}).bake();
  for (const ProbeDocument& probe : probes_of(result)) EXPECT_FALSE(probe.sh_window);
}

TEST(ProbesWindow, WindowsEveryProbeAndSaysWhatThatTook) {
  const Assembly plain = Job({5}).bake();
  const ShRgb& before = probes_of(plain)[0].sh.sh;
  for (const ShWindow window : {ShWindow::hann, ShWindow::lanczos, ShWindow::minimal}) {
    const Assembly result = Job({5, window, ShQuantity::radiance}).bake();
    const ProbeDocument& probe = probes_of(result)[0];
    ASSERT_TRUE(probe.sh_window);
    const ShWindowReport& report = *probe.sh_window;
    EXPECT_EQ(report.window, window);
    EXPECT_EQ(report.quantity, ShQuantity::radiance);
    ASSERT_EQ(report.factors.size(), 5u);
    EXPECT_LT(report.before.lowest, -0.01);
    EXPECT_GT(report.energy_removed, 0);
    EXPECT_GT(report.contrast_removed, 0);
    if (window == ShWindow::minimal) {
      EXPECT_GT(report.lambda, 0);
      EXPECT_GE(report.after.lowest, -2e-6);
    }
    for (int l = 0; l < 5; ++l) {
      for (int m = -l; m <= l; ++m) {
        const size_t i = sh_index(l, m);
        EXPECT_EQ(probe.sh.sh.coefficients[i],
                  before.coefficients[i] * report.factors[static_cast<size_t>(l)]);
      }
    }
    // The self-test is of what is returned; the images and their error are what they were.
    const ShSelftest& test = probe.sh.selftest.front();
    EXPECT_LT(length(sh_evaluate(probe.sh.sh, test.direction) - test.radiance), 1e-12);
    EXPECT_EQ(probe.error, probes_of(plain)[0].error);
    for (size_t i = 0; i < plain.artifacts.size(); ++i)
      EXPECT_EQ(result.artifacts[i].bytes, plain.artifacts[i].bytes);
    // A probe without light has nothing to window.
    EXPECT_EQ(probes_of(result)[1].sh_window->energy_removed, 0);
  }
}

TEST(ProbesWindow, IsJudgedByTheOrderedReconstruction) {
  const auto lambda = [](ShQuantity quantity) {
    return probes_of(Job({5, ShWindow::minimal, quantity}).bake())[0].sh_window->lambda;
  };
  EXPECT_GT(lambda(ShQuantity::radiance), lambda(ShQuantity::irradiance));
}

TEST(ProbesWindow, GivesTheSameCoefficientsForAnyThreads) {
  const Job job({4, ShWindow::minimal});
  const Assembly one = job.bake(1), two = job.bake(2);
  EXPECT_EQ(probes_of(one)[0].sh.sh.coefficients, probes_of(two)[0].sh.sh.coefficients);
  EXPECT_EQ(probes_of(one)[0].sh_window->factors, probes_of(two)[0].sh_window->factors);
}

TEST(ProbesWindow, IsPricedByItsSearches) {
  EXPECT_EQ(window_seconds(ShWindow::none, 33), 0);
  EXPECT_GT(window_seconds(ShWindow::hann, 33), 0);
  EXPECT_GT(window_seconds(ShWindow::minimal, 33), 2 * window_seconds(ShWindow::hann, 33));
  EXPECT_DOUBLE_EQ(window_seconds(ShWindow::minimal, 32),
                   64 * window_seconds(ShWindow::minimal, 4));
}

}  // namespace
}  // namespace lightkiln::test

// What an order of coefficients brings beside them.

#include <cmath>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "tests/bake/maps_orders.h"
#include "tests/reference/engine_sh.h"
#include "tests/reference/sphere_twins.h"

namespace lightkiln {
namespace {

EnvironmentDocument bake(const EnvironmentMapsParameters& parameters, const Image& map,
                         double target_error = 0.001, Plan* plan = nullptr) {
  Spec spec = test::order(parameters);
  spec.accuracy.target_error = target_error;
  return test::document_of(test::bake(spec, test::exr_of(map), 1, plan));
}

EnvironmentMapsParameters sh_order(const ShOutput& sh) {
  EnvironmentMapsParameters parameters;
  parameters.sh = sh;
  return parameters;
}

Image constant_map(float value) {
  Image map(32, 16, 3);
  for (float& v : map.pixels) v = value;
  return map;
}

TEST(MapsHarmonics, BringNothingThatIsNotOrdered) {
  const EnvironmentDocument document = bake(sh_order({3}), reference::test_sky(16, 100));
  EXPECT_TRUE(document.sh);
  EXPECT_FALSE(document.sh_window);
  EXPECT_FALSE(document.zh3);
  EXPECT_FALSE(document.spectrum);
  EXPECT_TRUE(document.sh_exports.empty());
}

TEST(MapsHarmonics, WindowWhatTheyReturnAndSayWhatThatTook) {
  const Image sky = reference::test_sky(32, 2000);
  const EnvironmentDocument plain = bake(sh_order({5}), sky);
  ShOutput order{5, ShWindow::minimal, ShQuantity::radiance};
  const EnvironmentDocument document = bake(sh_order(order), sky);
  ASSERT_TRUE(document.sh_window);
  const ShWindowReport& report = *document.sh_window;
  EXPECT_GT(report.lambda, 0);
  EXPECT_LT(report.before.lowest, -0.01);
  EXPECT_GE(report.after.lowest, -2e-6);
  EXPECT_GT(report.energy_removed, 0);
  EXPECT_GT(report.contrast_removed, 0);
  ASSERT_EQ(report.factors.size(), 5u);
  for (int l = 0; l < 5; ++l) {
    const size_t i = sh_index(l, -l);
    EXPECT_NEAR(document.sh->sh.coefficients[i].x,
                plain.sh->sh.coefficients[i].x * report.factors[static_cast<size_t>(l)], 1e-12);
  }
  EXPECT_EQ(document.sh->sh.coefficients[0], plain.sh->sh.coefficients[0]);
  // The self-test is of what is returned.
  const ShSelftest& test = document.sh->selftest.front();
  EXPECT_LT(length(sh_evaluate(document.sh->sh, test.direction) - test.radiance), 1e-12);
}

TEST(MapsHarmonics, MakeZh3FromThreeBandsHoweverFewAreOrdered) {
  const Image sky = reference::test_sky(32, 2000);
  ShOutput two{2};
  two.zh3 = true;
  ShOutput windowed{9, ShWindow::hann};
  windowed.zh3 = true;
  const EnvironmentDocument a = bake(sh_order(two), sky), b = bake(sh_order(windowed), sky);
  ASSERT_TRUE(a.zh3 && b.zh3);
  EXPECT_EQ(a.sh->sh.bands, 2);
  EXPECT_LT(length(a.zh3->fitted - b.zh3->fitted), 1e-9 * length(b.zh3->fitted));
  EXPECT_GT(a.zh3->linear_error, a.zh3->fitted_error);
}

TEST(MapsHarmonics, ExportEveryOrderedEngineOfTheReturnedCoefficients) {
  ShOutput order{9, ShWindow::lanczos};
  order.exports = 0b1000011;
  const EnvironmentDocument document = bake(sh_order(order), reference::test_sky(32, 2000));
  ASSERT_EQ(document.sh_exports.size(), 3u);
  EXPECT_EQ(document.sh_exports[0].target, ShTarget::three);
  EXPECT_EQ(document.sh_exports[1].target, ShTarget::filament);
  EXPECT_EQ(document.sh_exports[2].target, ShTarget::ext_lights_image_based);
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_LT(length(document.sh_exports[0].coefficients[i] - document.sh->sh.coefficients[i]),
              1e-12);
  }
}

TEST(MapsHarmonics, RecommendTheFewestBandsForTheOrderedError) {
  EnvironmentMapsParameters parameters;
  parameters.spectrum = SpectrumOutput{40};
  const Image sky = reference::test_sky(32, 40);
  const EnvironmentDocument document = bake(parameters, sky, 0.02);
  ASSERT_TRUE(document.spectrum);
  const SpectrumDocument& spectrum = *document.spectrum;
  EXPECT_EQ(spectrum.ordered.error, 0.02);
  EXPECT_EQ(spectrum.quoted.size(), 5u);
  EXPECT_EQ(spectrum.rows, 40);
  ASSERT_EQ(spectrum.spectrum.rows.size(), 129u);  // as far as advice goes
  const int enough = spectrum.ordered.irradiance_bands;
  ASSERT_GT(enough, 1);
  // Seen with the map's own irradiance: enough bands meet the order, one fewer do not.
  const auto rms = [&](int bands) {
    const ShRgb few = bake(sh_order({bands}), sky).sh->sh, many = bake(sh_order({40}), sky).sh->sh;
    Vec3d square;
    int count = 0;
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 48; ++x) {
        const double z = -1 + (y + 0.5) / 12, r = std::sqrt(1 - z * z), phi = kPi * x / 24;
        const Vec3d n{r * std::cos(phi), r * std::sin(phi), z};
        const Vec3d difference = sh_irradiance(few, n) - sh_irradiance(many, n);
        square += difference * difference;
        ++count;
      }
    }
    return std::sqrt(std::max({square.x, square.y, square.z}) / count) /
           (kPi * luminance(document.mean));
  };
  EXPECT_LE(rms(enough), 0.0205);
  EXPECT_GT(rms(enough - 1), 0.0195);
  // A pure function of chunks: the same table with other products beside it.
  parameters.sh = ShOutput{7};
  const EnvironmentDocument both = bake(parameters, sky, 0.02);
  EXPECT_EQ(both.spectrum->spectrum.rows[39].radiance_rms, spectrum.spectrum.rows[39].radiance_rms);
}

TEST(MapsHarmonics, AnswerAConstantMapInClosedForm) {
  ShOutput order{129, ShWindow::minimal, ShQuantity::radiance};
  order.zh3 = true;
  order.exports = 127;
  EnvironmentMapsParameters parameters = sh_order(order);
  parameters.spectrum = SpectrumOutput{129};
  Plan plan;
  const EnvironmentDocument document = bake(parameters, constant_map(2), 0.001, &plan);
  EXPECT_EQ(plan.max_samples, 0u);  // no band is projected
  EXPECT_EQ(document.sh_window->lambda, 0);
  EXPECT_EQ(document.sh_window->after.lowest, 1);
  EXPECT_EQ(document.zh3->linear_error, 0);
  EXPECT_EQ(document.sh_exports.size(), 7u);
  EXPECT_EQ(document.spectrum->ordered.radiance_bands, 1);
  EXPECT_EQ(document.spectrum->ordered.irradiance_bands, 1);
}

TEST(MapsHarmonics, OfBlackAreBlack) {
  ShOutput order{3, ShWindow::minimal};
  order.zh3 = true;
  order.exports = 127;
  EnvironmentMapsParameters parameters = sh_order(order);
  parameters.spectrum = SpectrumOutput{3};
  const EnvironmentDocument document = bake(parameters, constant_map(0));
  for (const ShExport& sh : document.sh_exports) {
    for (const Vec3d& c : sh.coefficients) EXPECT_EQ(length(c), 0);
  }
  EXPECT_EQ(document.spectrum->ordered.radiance_bands, 1);
}

}  // namespace
}  // namespace lightkiln

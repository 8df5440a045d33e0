// The files for other engines, read back as their users read them.

#include <cmath>
#include <cstdio>
#include <cstring>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "proto/json_value.h"
#include "tests/reference/engine_sh.h"

namespace lightkiln {
namespace {

ShRgb sky() {
  ShRgb sh(3);
  for (size_t i = 0; i < 9; ++i) {
    const double t = static_cast<double>(i);
    sh.coefficients[i] = {std::sin(1 + t), std::cos(2 * t), 0.1 * t - 0.3};
  }
  sh.coefficients[0] = {5, 6, 7};
  return sh;
}

std::string file_of(ShTarget target, std::string* name = nullptr, std::string* type = nullptr) {
  EnvironmentDocument document;
  document.sh_exports.push_back(export_sh(sky(), target));
  Assembly assembly;
  assembly.document = document;
  const std::vector<Artifact> files = write_exports(assembly);
  EXPECT_EQ(files.size(), 1u);
  if (name) *name = files[0].name;
  if (type) *type = files[0].media_type;
  std::string text(files[0].bytes.size(), '\0');
  std::memcpy(text.data(), files[0].bytes.data(), text.size());
  return text;
}

JsonValue json_of(ShTarget target) {
  return read_trusted_json(file_of(target), ErrorCode::internal, "export");
}

std::vector<double> numbers_of(const JsonValue& list) {
  std::vector<double> numbers;
  for (const JsonValue& value : *list.array()) numbers.push_back(value.number());
  return numbers;
}
Vec3d vector_of(const JsonValue& list) {
  const auto numbers = numbers_of(list);
  return {numbers.at(0), numbers.at(1), numbers.at(2)};
}
std::vector<Vec3d> vectors_of(const JsonValue& list) {
  std::vector<Vec3d> vectors;
  for (const JsonValue& value : *list.array()) vectors.push_back(vector_of(value));
  return vectors;
}

// The self-test that stands in the file, by the engine's formula on the file's own numbers.
void expect_passes(const JsonValue& json, const auto& diffuse) {
  const JsonValue::Array& tests = *json.find("lightkiln")->find("selftest")->array();
  ASSERT_EQ(tests.size(), 6u);
  for (const JsonValue& test : tests) {
    const Vec3d normal = vector_of(*test.find("normal"));
    EXPECT_LT(length(diffuse(normal) - vector_of(*test.find("diffuse"))), 3e-5);
  }
  EXPECT_NE(json.find("lightkiln")->find("use"), nullptr);
}

TEST(ShExports, ThreeLoadsALightProbe) {
  const JsonValue json = json_of(ShTarget::three);
  EXPECT_EQ(*json.find("object")->find("type")->string(), "LightProbe");
  const auto flat = numbers_of(*json.find("object")->find("sh"));
  ASSERT_EQ(flat.size(), 27u);
  std::vector<Vec3d> nine;
  for (size_t i = 0; i < 27; i += 3) nine.push_back({flat[i], flat[i + 1], flat[i + 2]});
  expect_passes(json, [&](const Vec3d& n) { return reference::three_irradiance(nine, n) / kPi; });
}

TEST(ShExports, FilamentReadsTheNineLinesOfCmgen) {
  std::string name, type;
  const std::string text = file_of(ShTarget::filament, &name, &type);
  EXPECT_EQ(name, "sh_filament.txt");
  EXPECT_EQ(type, "text/plain");
  std::vector<Vec3d> nine;
  const char* at = text.c_str();
  for (int i = 0; i < 9; ++i) {
    Vec3d c;
    int length = 0;
    ASSERT_EQ(std::sscanf(at, "(%lf, %lf, %lf); // L%n", &c.x, &c.y, &c.z, &length), 3);
    ASSERT_GT(length, 0);
    nine.push_back(c);
    at = std::strchr(at, '\n') + 1;
  }
  EXPECT_EQ(*at, '\0');
  const Vec3d n = normalize(Vec3d{1, -2, 3});
  EXPECT_LT(length(reference::filament_diffuse(nine, n) - sh_irradiance(sky(), n) / kPi), 1e-12);
}

TEST(ShExports, UnityFillsSphericalHarmonicsL2) {
  const JsonValue json = json_of(ShTarget::unity);
  const auto flat = numbers_of(*json.find("coefficients"));
  ASSERT_EQ(flat.size(), 27u);
  expect_passes(json, [&](const Vec3d& n) { return reference::unity_diffuse(flat, n); });
}

TEST(ShExports, UnrealFillsFShVectorRgb3AndItsPackedForm) {
  const JsonValue json = json_of(ShTarget::unreal);
  const auto r = numbers_of(*json.find("R")), g = numbers_of(*json.find("G")),
             b = numbers_of(*json.find("B"));
  std::vector<Vec3d> nine;
  for (size_t i = 0; i < 9; ++i) nine.push_back({r.at(i), g.at(i), b.at(i)});
  const auto packed = reference::unreal_pack(nine);
  expect_passes(json, [&](const Vec3d& n) { return reference::unreal_diffuse(packed, n); });
  std::vector<std::array<double, 4>> stored;
  for (const JsonValue& row : *json.find("sky_irradiance_environment_map")->array()) {
    const auto v = numbers_of(row);
    stored.push_back({v.at(0), v.at(1), v.at(2), v.at(3)});
  }
  ASSERT_EQ(stored.size(), 7u);
  expect_passes(json, [&](const Vec3d& n) { return reference::unreal_diffuse(stored, n); });
}

TEST(ShExports, BabylonTakesHarmonicsAndTheIrradianceOfEnvFiles) {
  const JsonValue json = json_of(ShTarget::babylon);
  const auto harmonics = vectors_of(*json.find("sphericalHarmonics"));
  expect_passes(json, [&](const Vec3d& n) { return reference::babylon_diffuse(harmonics, n); });
  std::vector<Vec3d> polynomial;
  for (const char* term : {"x", "y", "z", "xx", "yy", "zz", "yz", "zx", "xy"}) {
    polynomial.push_back(vector_of(*json.find("irradiance")->find(term)));
  }
  const auto again = reference::babylon_from_polynomial(polynomial);
  expect_passes(json, [&](const Vec3d& n) { return reference::babylon_diffuse(again, n); });
}

TEST(ShExports, GodotTakesNineColours) {
  const JsonValue json = json_of(ShTarget::godot);
  const auto nine = vectors_of(*json.find("point_sh"));
  EXPECT_EQ(json.find("point_sh")->array()->at(4).array()->at(3).number(), 1);
  expect_passes(json, [&](const Vec3d& n) { return reference::godot_diffuse(nine, n); });
}

TEST(ShExports, TheGltfExtensionTakesNineRows) {
  const JsonValue json = json_of(ShTarget::ext_lights_image_based);
  const auto nine = vectors_of(*json.find("irradianceCoefficients"));
  ASSERT_EQ(nine.size(), 9u);
  expect_passes(json,
                [&](const Vec3d& n) { return reference::ext_lights_image_based_diffuse(nine, n); });
}

TEST(DocumentJson, TellsWindowZh3AndSpectrum) {
  EnvironmentDocument document;
  ShWindowReport report;
  report.window = ShWindow::minimal;
  report.lambda = 0.25;
  report.factors = {1, 0.5};
  document.sh_window = report;
  document.zh3 = make_zh3(sky());
  document.sh_exports.push_back(export_sh(sky(), ShTarget::unity));
  SpectrumDocument spectrum;
  const std::vector<Vec3d> energy = {{4, 4, 4}, {1, 1, 1}};
  spectrum.spectrum = make_spectrum(energy, {6, 6, 6}, {1, 1, 1}, 2);
  spectrum.rows = 2;
  spectrum.ordered = advise_bands(spectrum.spectrum, 0.01);
  spectrum.quoted = {advise_bands(spectrum.spectrum, 0.9)};
  document.spectrum = spectrum;
  Assembly assembly;
  assembly.document = document;
  Spec spec;
  spec.environment = InputRef{sha256_digest("x", 1), {}};
  spec.parameters = EnvironmentMapsParameters{};
  const JsonValue json =
      read_trusted_json(write_document(assembly, spec, Plan{}), ErrorCode::internal, "x");
  EXPECT_EQ(json.find("sh_window")->find("lambda")->number(), 0.25);
  EXPECT_EQ(*json.find("sh_window")->find("window")->string(), "minimal");
  EXPECT_EQ(json.find("sh_window")->find("factors")->array()->size(), 2u);
  EXPECT_EQ(json.find("zh3")->find("linear")->array()->size(), 4u);
  EXPECT_EQ(*json.find("sh_exports")->array()->at(0).find("artifact")->string(), "sh_unity.json");
  const JsonValue* told = json.find("spectrum");
  EXPECT_EQ(told->find("rows")->array()->size(), 2u);
  EXPECT_TRUE(told->find("recommendation")->find("radiance_bands")->is_null());
  EXPECT_EQ(told->find("recommendations")->array()->at(0).find("radiance_bands")->number(), 1);
}

}  // namespace
}  // namespace lightkiln

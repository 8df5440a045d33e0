#include "proto/harmonics_json.h"

#include <span>

#include "proto/json.h"

namespace lightkiln {
namespace {

void write_extremes(JsonWriter& writer, const ShExtremes& extremes) {
  writer.begin_object()
      .member("lowest", extremes.lowest)
      .member("luminance_min", extremes.luminance_min)
      .member("luminance_max", extremes.luminance_max)
      .end_object();
}

void write_window(JsonWriter& writer, const ShWindowReport& report) {
  constexpr const char* kWindows[] = {"none", "hann", "lanczos", "minimal"};
  writer.begin_object()
      .member("window", kWindows[static_cast<size_t>(report.window)])
      .member("quantity", report.quantity == ShQuantity::radiance ? "radiance" : "irradiance")
      .member("lambda", report.lambda)
      .member("unit",
              "extremes of the reconstruction: lowest of any channel relative to its mean, "
              "luminance relative to the mean luminance")
      .key("before");
  write_extremes(writer, report.before);
  writer.key("after");
  write_extremes(writer, report.after);
  writer.key("proven_lowest");
  if (report.window == ShWindow::minimal)
    writer.value(report.proven_lowest);
  else
    writer.null();
  writer.member("energy_removed", report.energy_removed)
      .member("contrast_removed", report.contrast_removed)
      .key("factors")
      .begin_array();
  for (const double factor : report.factors) writer.value(factor);
  writer.end_array().end_object();
}

void write_zh3(JsonWriter& writer, const Zh3& zh3) {
  writer.begin_object().key("linear").begin_array();
  for (const Vec3d& c : zh3.linear) writer.value(c);
  writer.end_array()
      .member("axis", zh3.axis)
      .member("fitted", zh3.fitted)
      .member("hallucinated", zh3.hallucinated)
      .member("quantity",
              "radiance coefficients: bands 0 and 1, and of y_20 about the axis; irradiance takes "
              "the factors pi, 2 pi/3, pi/4")
      .key("irradiance_error")
      .begin_object()
      .member("unit", "rms against three full bands, of the worst channel, relative to its mean")
      .member("linear", zh3.linear_error)
      .member("hallucinated", zh3.hallucinated_error)
      .member("fitted", zh3.fitted_error)
      .end_object()
      .end_object();
}

void write_advice(JsonWriter& writer, const BandAdvice& advice) {
  const auto bands = [&](const char* name, int count) {
    writer.key(name);
    if (count > 0)
      writer.value(count);
    else
      writer.null();
  };
  writer.begin_object().member("error", advice.error);
  bands("radiance_bands", advice.radiance_bands);
  bands("irradiance_bands", advice.irradiance_bands);
  writer.end_object();
}

void write_spectrum(JsonWriter& writer, const SpectrumDocument& document) {
  writer.begin_object()
      .member("total_energy", document.spectrum.total_energy)
      .member("unit",
              "energy: squared radiance over the sphere, by channel; errors of keeping this many "
              "bands: rms over the sphere of the worst channel, relative to the mean luminance; "
              "irradiance_max bounds every direction")
      .key("recommendation");
  write_advice(writer, document.ordered);
  writer.key("recommendations").begin_array();
  for (const BandAdvice& advice : document.quoted) write_advice(writer, advice);
  writer.end_array().key("rows").begin_array();
  const std::span rows(document.spectrum.rows);
  for (const BandRow& row : rows.first(static_cast<size_t>(document.rows)))
    writer.begin_object()
        .member("bands", row.bands)
        .member("energy", row.energy)
        .member("radiance_rms", row.radiance_rms)
        .member("irradiance_rms", row.irradiance_rms)
        .member("irradiance_max", row.irradiance_max)
        .end_object();
  writer.end_array().member("error_bound", document.error_bound);
  write_measured(writer, document.measured);
  writer.end_object();
}

// null where nothing was ordered.
template <typename T>
void write_ordered(JsonWriter& writer, const char* name, const std::optional<T>& part,
                   const auto& write) {
  writer.key(name);
  if (part)
    write(writer, *part);
  else
    writer.null();
}

}  // namespace

void write_sh_window(JsonWriter& writer, const std::optional<ShWindowReport>& report) {
  write_ordered(writer, "sh_window", report, write_window);
}

void write_harmonics(JsonWriter& writer, const EnvironmentDocument& document) {
  write_sh_window(writer, document.sh_window);
  write_ordered(writer, "zh3", document.zh3, write_zh3);
  writer.key("sh_exports").begin_array();
  for (const ShExport& sh : document.sh_exports)
    writer.begin_object()
        .member("target", sh_target_name(sh.target))
        .member("artifact", export_name(sh.target))
        .end_object();
  writer.end_array();
  write_ordered(writer, "spectrum", document.spectrum, write_spectrum);
}

}  // namespace lightkiln

#include "core/bake/window_report.h"

#include "core/bake/maps_cost.h"

namespace lightkiln {

namespace {

// One list of members for both directions.
void visit_report(auto& report, const auto& visit) {
  visit(report.lambda);
  for (auto& factor : report.factors) visit(factor);
  for (auto* extremes : {&report.before, &report.after}) {
    visit(extremes->lowest);
    visit(extremes->luminance_min);
    visit(extremes->luminance_max);
  }
  visit(report.proven_lowest);
  visit(report.energy_removed);
  visit(report.contrast_removed);
}

}  // namespace

void write_window_report(const ShWindowReport& report, ByteWriter& writer) {
  visit_report(report, [&](double value) { writer.f64(value); });
}

ShWindowReport read_window_report(ShWindow window, ShQuantity quantity, int bands,
                                  ByteReader& reader) {
  ShWindowReport report;
  report.window = window;
  report.quantity = quantity;
  report.factors.resize(static_cast<size_t>(bands));
  visit_report(report, [&](double& value) { value = reader.f64(); });
  return report;
}

double window_seconds(ShWindow window, int bands) {
  if (window == ShWindow::none) return 0;
  constexpr double kSearchesForExtremes = 6;
  const double searches = window == ShWindow::minimal ? kWindowSearches : kSearchesForExtremes;
  return searches * kPerSearch * bands * bands;
}

}  // namespace lightkiln

// The split-sum table: a product that no light enters.

#include "core/bake/maps_cost.h"
#include "core/bake/maps_output.h"
#include "core/base/parallel.h"
#include "core/environment/dfg.h"
#include "core/image/exr.h"

namespace lightkiln {

namespace {

class DfgTable : public MapsOutput {
 public:
  explicit DfgTable(int size) : size_(size) {}

  double error_bound() const override { return kDfgErrorBound; }
  double model_seconds(MapsLight&) const override { return kPerDfgValue * size_ * size_; }

  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    const Image table = dfg_table(size_, {}, light.threads(), progress);
    writer.floats(table.pixels);
    ErrorMeter meter(1);
    constexpr int kTwinRefinement = 8;
    const size_t side = static_cast<size_t>(size_);
    for (int i = 0; i < check_texels; ++i) {
      const size_t index = check_index(i, side * side);
      const int x = static_cast<int>(index % side), y = static_cast<int>(index / side);
      const double roughness = (y + 0.5) / size_;
      const DfgValue truth = ggx_dfg(roughness * roughness, (x + 0.5) / size_, kTwinRefinement);
      meter.add(to_double(table.rgb(x, y)), {truth.scale, truth.bias, 0});
    }
    return meter.result();
  }

  void file(ByteReader& reader, const MeasuredError& measured, Assembly* assembly,
            EnvironmentDocument* document) const override {
    Image table(size_, size_, 3);
    reader.floats(table.pixels);
    ExrWriteOptions options;
    options.pixel_type = ExrPixelType::float32;
    options.attributes["lightkiln.axes"] =
        "column: n.v = (x + 1/2)/size; row: roughness = (y + 1/2)/size from the top; R: scale of "
        "F0, G: bias";
    assembly->artifacts.push_back({"dfg.exr", "image", "image/x-exr", write_exr(table, options)});
    document->dfg = MapDocument{"dfg.exr", size_, 0, kDfgErrorBound, measured};
  }

 private:
  int size_;
};

void order_dfg(const EnvironmentMapsParameters& parameters, MapsLight&, double,
               MapsOutputs* outputs) {
  outputs->push_back(std::make_unique<DfgTable>(parameters.dfg->size));
}

}  // namespace

const MapsProduct kDfgProduct = {
    "dfg", "A DFG table is ordered.", false,
    [](const EnvironmentMapsParameters& parameters) { return parameters.dfg.has_value(); },
    order_dfg};

double measure_speed() {
  constexpr int kCount = 64;
  double sum = 0;
  const double start_s = thread_cpu_seconds();
  for (int i = 1; i <= kCount; ++i) sum += ggx_dfg(0.25, double(i) / kCount).scale;
  const double spent_s = thread_cpu_seconds() - start_s;
  return sum > 0 ? std::clamp(spent_s / (kCount * kPerDfgValue), 0.05, 20.0) : 1.0;
}

}  // namespace lightkiln

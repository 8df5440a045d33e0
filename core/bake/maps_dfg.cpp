// The split-sum table: a product that no light enters.

#include "core/bake/maps_cost.h"
#include "core/bake/maps_output.h"
#include "core/base/parallel.h"
#include "core/environment/charlie_albedo.h"
#include "core/environment/dfg.h"
#include "core/image/exr.h"

namespace lightkiln {

namespace {

class DfgTable : public MapsOutput {
 public:
  DfgTable(const DfgOutput& order, double error)
      : size_(order.size), options_{order.multiple_scattering, order.charlie, error} {}

  double error_bound() const override { return dfg_table_bound(options_); }
  double model_seconds(MapsLight&) const override {
    const DfgTableWork work = dfg_table_work(options_);
    return (kPerDfgPoint * work.ggx + kPerCharliePoint * work.sheen) * size_ * size_;
  }

  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    const Image table = dfg_table(size_, options_, light.threads(), progress);
    writer.floats(table.pixels);
    ErrorMeter meter(1);
    constexpr int kTwinRefinement = 8;
    const size_t side = static_cast<size_t>(size_);
    for (int i = 0; i < check_texels; ++i) {
      const size_t index = check_index(i, side * side);
      const int x = static_cast<int>(index % side), y = static_cast<int>(index / side);
      const double roughness = (y + 0.5) / size_;
      const double alpha = roughness * roughness, cosine = (x + 0.5) / size_;
      const DfgValue value = ggx_dfg(alpha, cosine, kTwinRefinement);
      const double white = value.scale + value.bias;
      Vec3d truth = options_.multiple_scattering ? Vec3d{value.bias, white, 0}
                                                 : Vec3d{value.scale, value.bias, 0};
      Vec3d found = to_double(table.rgb(x, y));
      if (options_.charlie) {
        // Sheen's albedo may exceed 1 and is held to its bound relative to itself there.
        const double albedo = charlie_albedo(alpha, cosine, kTwinRefinement);
        truth.z = albedo / std::max(1.0, albedo);
        found.z /= std::max(1.0, albedo);
      }
      meter.add(found, truth);
    }
    return meter.result();
  }

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    Image table(size_, size_, 3);
    reader.floats(table.pixels);
    ExrWriteOptions options;
    options.pixel_type = ExrPixelType::float32;
    options.attributes["lightkiln.axes"] =
        "column: n.v = (x + 1/2)/size; row: roughness = (y + 1/2)/size from the top";
    options.attributes["lightkiln.channels"] = channels();
    options.threads = result->threads;
    add_image("dfg.exr", table, options, &result->assembly);
    result->document.dfg = DfgDocument{{"dfg.exr", size_, 0, error_bound(), measured},
                                       options_.multiple_scattering,
                                       options_.charlie};
  }

 private:
  std::string channels() const {
    return std::string(options_.multiple_scattering
                           ? "R: bias, G: E = scale + bias; reflected = (F0 (G - R) + R) (1 + F0 "
                             "(1/G - 1))"
                           : "R: scale of F0, G: bias; reflected = F0 R + G") +
           (options_.charlie ? "; B: albedo of Charlie sheen" : "; B: 0");
  }

  int size_;
  DfgTableOptions options_;
};

// The bound holds for every entry of the table, so that nothing is held back for a single one.
void order_dfg(const EnvironmentMapsParameters& parameters, MapsLight&, double target,
               MapsOutputs* outputs) {
  outputs->push_back(std::make_unique<DfgTable>(*parameters.dfg, ordered_error(target)));
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
  return sum > 0 ? std::clamp(spent_s / (kCount * kDfgPoints * kPerDfgPoint), 0.05, 20.0) : 1.0;
}

}  // namespace lightkiln

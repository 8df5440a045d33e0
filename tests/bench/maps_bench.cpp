// What the accuracy of each environment-map product costs: every product alone, at a ladder of
// ordered errors, with the CPU seconds it took and the error measured against the slow twin.
//
//   bench_maps [--smoke] [--json FILE] [map.hdr|map.exr]

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "core/bake/maps_output.h"
#include "core/base/parallel.h"
#include "core/image/decode.h"
#include "proto/json_writer.h"
#include "proto/spec_table.h"
#include "tests/reference/sphere_twins.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

struct Order {
  int height, repetitions, checks;
  bool whole_ladder;
};

struct Point {
  std::string product;
  double target = 0, bound = 0;
  MeasuredError measured;
  double cpu_s = 0;  // median of the repetitions
  int bands = 0;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// One bake of one product: a fresh light, so that the shared projection is paid for each time.
struct Baked {
  double cpu_s = 0, bound = 0;
  MeasuredError measured;
  int bands = 0;
};
Baked bake_once(const Environment& map, const EnvironmentMapsParameters& parameters, double target,
                int checks) {
  Progress progress;
  const double start_s = process_cpu_seconds();
  MapsLight light(map, 0, sun_options(parameters));
  const MapsOutputs outputs = order_outputs(parameters, light, working_target(target));
  require_spectrum(outputs, &light);
  Baked baked;
  for (const auto& output : outputs) {
    ByteWriter writer;
    const MeasuredError measured = output->make(light, checks, writer, progress);
    baked.bound = std::max(baked.bound, output->error_bound());
    baked.measured.count += measured.count;
    baked.measured.rms = std::max(baked.measured.rms, measured.rms);
    baked.measured.max = std::max(baked.measured.max, measured.max);
  }
  baked.bands = light.bands();
  baked.cpu_s = process_cpu_seconds() - start_s;
  return baked;
}

Point measure(const Environment& map, const EnvironmentMapsParameters& parameters,
              const std::string& name, double target, const Order& order) {
  const Baked checked = bake_once(map, parameters, target, order.checks);
  std::vector<double> seconds;
  for (int i = 0; i < order.repetitions; ++i)
    seconds.push_back(bake_once(map, parameters, target, 0).cpu_s);
  return {name, target, checked.bound, checked.measured, median(seconds), checked.bands};
}

void climb_one(const Environment& map, const EnvironmentMapsParameters& parameters,
               const std::string& name, const Order& order, std::vector<Point>* points) {
  for (const double target : kQuotedErrors) {
    points->push_back(measure(map, parameters, name, target, order));
    const Point& p = points->back();
    std::printf("%-20s %9.1e %9.1e %11.2e %11.2e %9.4f %6d\n", p.product.c_str(), p.target, p.bound,
                p.measured.rms, p.measured.max, p.cpu_s, p.bands);
    std::fflush(stdout);
    if (!order.whole_ladder) break;
  }
}

std::vector<Point> climb(const Environment& map, const Order& order) {
  std::vector<Point> points;
  std::printf("%-20s %9s %9s %11s %11s %9s %6s\n", "product", "ordered", "bound", "seen rms",
              "seen max", "CPU s", "bands");
  for (const ParameterGroup& group : kind_table(Kind::environment_maps).groups) {
    const std::string name(group.path.substr(group.path.rfind('/') + 1));
    const auto products = maps_products();
    const bool product = std::any_of(products.begin(), products.end(),
                                     [&](const MapsProduct& p) { return name == p.name; });
    if (!product || !group.create || name == kLayoutsProduct.name) continue;
    Spec spec = empty_spec(Kind::environment_maps);
    group.create(spec);
    climb_one(map, std::get<EnvironmentMapsParameters>(spec.parameters), name, order, &points);
  }
  for (const auto& [kind, size] :
       {std::pair{LayoutKind::octahedral, 512}, std::pair{LayoutKind::horizontal_cross, 256},
        std::pair{LayoutKind::angular, 512}}) {
    EnvironmentMapsParameters parameters;
    LayoutOutput output;
    output.size = order.whole_ladder ? size : size / 16;
    parameters.layouts[static_cast<size_t>(kind)] = output;
    climb_one(map, parameters, std::string("to ") + layout_name(kind), order, &points);
  }
  return points;
}

std::string write_points(const std::vector<Point>& points, const Image& map) {
  JsonWriter writer;
  writer.begin_object()
      .key("map")
      .begin_object()
      .member("width", map.width)
      .member("height", map.height)
      .end_object()
      .key("points")
      .begin_array();
  for (const Point& p : points)
    writer.begin_object()
        .member("product", p.product)
        .member("target", p.target)
        .member("bound", p.bound)
        .member("rms", p.measured.rms)
        .member("max", p.measured.max)
        .member("cpu_s", p.cpu_s)
        .member("bands", p.bands)
        .end_object();
  writer.end_array().end_object();
  return writer.take();
}

int run(int argc, char** argv) {
  Order order{1024, 3, 16, true};
  std::string json, file;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--smoke"))
      order = {32, 1, 1, false};
    else if (!std::strcmp(argv[i], "--json") && i + 1 < argc)
      json = argv[++i];
    else
      file = argv[i];
  }
  DecodedImage decoded;
  if (file.empty())
    decoded.image = reference::test_sky(order.height, 1e5);
  else
    decoded = decode_hdr_image(test::read_file(file));
  const Environment map = make_environment(decoded);
  std::printf("map %d x %d, %s\n", map.radiance.width, map.radiance.height,
              file.empty() ? "a sky with an unclipped sun" : file.c_str());
  const std::vector<Point> points = climb(map, order);
  if (!json.empty()) std::ofstream(json) << write_points(points, map.radiance) << "\n";
  return points.empty() ? 1 : 0;
}

}  // namespace
}  // namespace lightkiln

int main(int argc, char** argv) {
  return lightkiln::run(argc, argv);
}

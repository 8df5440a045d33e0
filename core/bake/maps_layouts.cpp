// The map in other layouts, converted from the file's own pixels.

#include "core/bake/maps_layouts.h"

#include <algorithm>
#include <cmath>

#include "core/bake/maps_cost.h"
#include "core/bake/maps_output.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/image/exr.h"

namespace lightkiln {

namespace {

std::string describe(const MapLayout& layout, FaceOrientation faces) {
  const bool opengl = faces == FaceOrientation::opengl;
  const std::string side = layout.mirrored ? "left and right exchanged, +X to the right of +Z"
                                           : "seen from inside, unmirrored, -X to the right of +Z";
  switch (layout.kind) {
    case LayoutKind::latlong:
      return "latlong: centre +Z, +X a quarter left of it, top row +Y, seen from inside";
    case LayoutKind::cube_strip:
      return describe_strip(faces);
    case LayoutKind::horizontal_cross:
      return opengl ? "horizontal cross: row -X +Z +X -Z of the world (-x, y, z), +Y above +Z, -Y "
                      "below it, unfolded: upright squares as OpenGL looks them up"
                    : "horizontal cross: row +X +Z -X -Z, +Y above +Z, -Y below it, unfolded";
    case LayoutKind::vertical_cross:
      return opengl ? "vertical cross: column +Y +Z -Y -Z of the world (-x, y, z), -X left and +X "
                      "right of +Z, unfolded: squares as OpenGL looks them up, -Z upside down"
                    : "vertical cross: column +Y +Z -Y -Z, +X left and -X right of +Z, unfolded";
    case LayoutKind::angular:
      return "angular map: centre +Z, radius = angle / 180 degrees, " + side;
    case LayoutKind::mirror_ball:
      return "mirror ball: centre +Z, camera " +
             (layout.camera_distance > 0
                  ? "at " + short_number(layout.camera_distance) + " radii of the ball, "
                  : std::string("infinitely far, ")) +
             side;
    case LayoutKind::octahedral:
      return "octahedral (Cigolle et al. 2014) about z: column from x, row from y, centre +Z";
    case LayoutKind::equal_area_octahedral:
      return "equal-area octahedral (Clarberg 2008) about z: column from x, row from y, centre +Z";
    case LayoutKind::hemisphere:
      return "upper hemisphere: centre +Y, +Z at the bottom edge, radius = angle / 90 degrees";
    case LayoutKind::hemisphere_equal_area:
      return "upper hemisphere: centre +Y, +Z at the bottom edge, Lambert's equal-area projection";
    case LayoutKind::cylinder:
      return "cylinder about +Y: columns as latlong, rows equal steps of tan(latitude) up to " +
             short_number(kPi * layout.height / layout.width);
    case LayoutKind::cylinder_equal_area:
      return "cylinder about +Y: columns as latlong, rows equal steps of sin(latitude)";
  }
  return "";
}

// Beyond this an order is coarse enough to be met by what costs least.
constexpr double kCoarsest = 0.05;

class LayoutImage : public MapsOutput {
 public:
  // `target` is the order that a bound of the whole is held to; a layout errs texel by texel.
  LayoutImage(size_t product, const LayoutOutput& order, const Environment& environment,
              double target)
      : product_(product), layout_(layout_of(product, order)) {
    moved_ = moves_texels(environment.source_image_layout(), layout_,
                          environment.source_image_rotation());
    exact_ = moved_ || environment.constant;
    constexpr double kUsed = 0.9;
    error_ = std::min(kCoarsest, kUsed * ordered_error(target));
  }

  double error_bound() const override { return exact_ ? 0 : error_; }

  double model_seconds(MapsLight& light) const override {
    const Image& source = light.environment().source_image();
    const double texels = double(source.width) * source.height;
    double seconds = kLookUpPerTexel * std::min(1e6, texels);
    if (moved_) return seconds;
    const ConversionWork work =
        estimate_conversion(light.conversion_source(), layout_,
                            light.environment().source_image_rotation(), kFilter, error_);
    if (work.walked) {
      const double size = cube_face_size(layout_);
      return seconds + kResamplePerCell * (source.width + 4 * size) * (source.height + 2 * size);
    }
    return seconds + conversion_seconds(work);
  }

  double check_seconds(MapsLight& light) const override {
    if (exact_) return 0;
    const Image& source = light.environment().source_image();
    const double across =
        std::sqrt(double(source.width) * source.height / (double(layout_.width) * layout_.height));
    const double ball = layout_.kind == LayoutKind::mirror_ball ? kBallCheck : 1;
    return kConvertPerCheck * (1 + across) * ball;
  }

  // Bytes: pixels, then what the round trip lost; it is measured when anything is to be checked.
  MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                     Progress& progress) const override {
    const Environment& environment = light.environment();
    const Rotation rotation = environment.source_image_rotation();
    const ConversionSource& source = light.conversion_source();
    const Image image =
        convert_layout(source, layout_, rotation, kFilter, error_, light.threads(), progress);
    writer.floats(image.pixels);
    writer.u64(check_texels > 0 ? 1 : 0);
    if (check_texels == 0) return {};
    const RoundTrip trip = measure_round_trip(source.layout, *source.image, layout_, image,
                                              rotation, light.threads(), progress);
    writer.f64(trip.relative_rms);
    writer.u64(trip.psnr_db ? 1 : 0);
    writer.f64(trip.psnr_db.value_or(0));
    writer.f64(trip.not_covered_share);
    writer.f64(trip.mean_before);
    writer.f64(trip.mean_after);
    if (exact_) return {};
    return check_layout(source, layout_, image, rotation, kFilter, check_texels, light.threads(),
                        progress);
  }

  void file(ByteReader& reader, const MeasuredError& measured, MapsResult* result) const override {
    Image image(layout_.width, layout_.height, 3);
    reader.floats(image.pixels);
    LayoutDocument entry;
    entry.name = layout_product_name(product_);
    entry.layout = layout_;
    if (is_cube(layout_.kind)) entry.faces = result->faces;
    if (layout_.kind == LayoutKind::cube_strip)
      image = ordered_faces(std::move(image), result->faces);
    entry.error_bound = error_bound();
    entry.measured = measured;
    if (reader.u64() != 0) entry.round_trip = read_trip(reader);
    const std::string stem = "layout_" + entry.name;
    if (product_ == kCubeFaces) {
      for (int face = 0; face < 6; ++face) {
        const std::string name = stem + "_" + kCubeFaceNames[static_cast<size_t>(face)] + ".exr";
        Image part(layout_.width, layout_.width, 3);
        std::copy_n(image.at(0, face * layout_.width), part.pixels.size(), part.pixels.begin());
        write(part, name,
              describe(layout_, entry.faces) + "; this file: face " + kCubeFaceNames[size_t(face)],
              entry.faces, result);
        entry.artifacts.push_back(name);
      }
    } else {
      write(image, stem + ".exr", describe(layout_, entry.faces), entry.faces, result);
      entry.artifacts.push_back(stem + ".exr");
    }
    result->document.layouts.push_back(std::move(entry));
  }

 private:
  static constexpr MapFilter kFilter = MapFilter::adaptive;

  static RoundTrip read_trip(ByteReader& reader) {
    RoundTrip trip;
    trip.relative_rms = reader.f64();
    const bool lossy = reader.u64() != 0;
    const double psnr_db = reader.f64();
    if (lossy) trip.psnr_db = psnr_db;
    trip.not_covered_share = reader.f64();
    trip.mean_before = reader.f64();
    trip.mean_after = reader.f64();
    return trip;
  }

  // OpenEXR's attribute is written exactly where its texel centres and its orientation are.
  EnvmapAttribute envmap(FaceOrientation faces) const {
    if (layout_.convention != TexelConvention::openexr) return EnvmapAttribute::none;
    if (layout_.kind == LayoutKind::latlong) return EnvmapAttribute::latlong;
    return faces == FaceOrientation::openexr ? EnvmapAttribute::cube : EnvmapAttribute::none;
  }

  void write(const Image& image, const std::string& name, const std::string& layout,
             FaceOrientation faces, MapsResult* result) const {
    ExrWriteOptions options;
    options.pixel_type = ExrPixelType::float32;
    options.envmap = envmap(faces);
    options.attributes["lightkiln.layout"] = layout;
    options.attributes["lightkiln.texel_convention"] =
        layout_.convention == TexelConvention::openexr ? "openexr: texel centres at i/(N - 1)"
                                                       : "half_texel: texel centres at (i + 1/2)/N";
    tell_faces(faces, &options.attributes);
    options.attributes["lightkiln.covered_share"] =
        short_number(covered_solid_angle(layout_) / (4 * kPi));
    options.threads = result->threads;
    add_image(name, image, options, &result->assembly);
  }

  size_t product_;
  MapLayout layout_;
  double error_;
  bool moved_, exact_;
};

}  // namespace

MeasuredError check_layout(const ConversionSource& source, const MapLayout& layout,
                           const Image& image, const Rotation& rotation, MapFilter filter,
                           int check_texels, int threads, Progress& progress) {
  struct Texel {
    int x, y;
    LayoutTruth truth;
  };
  constexpr int kLines = 128;
  std::vector<Texel> texels;
  const size_t width = static_cast<size_t>(layout.width);
  const size_t all = width * static_cast<size_t>(layout.height);
  // Of those that show something: half of some layouts does not.
  for (int i = 0; i < 8 * check_texels && texels.size() < static_cast<size_t>(check_texels); ++i) {
    const size_t index = check_index(i, all);
    const int x = static_cast<int>(index % width), y = static_cast<int>(index / width);
    const bool known = std::any_of(texels.begin(), texels.end(),
                                   [&](const Texel& t) { return t.x == x && t.y == y; });
    if (!known && texel_has_direction(layout, x, y)) texels.push_back({x, y, {}});
  }
  parallel_blocks(
      texels.size(), 1, threads, progress,
      [&](size_t i, size_t) {
        Texel& t = texels[i];
        t.truth =
            layout_truth(source.layout, *source.image, layout, rotation, filter, t.x, t.y, kLines);
      },
      1, 1);
  ErrorMeter meter(1);
  for (const Texel& t : texels) {
    const double scale = std::max(source.mean, t.truth.brightest);
    const double share = scale > 0 ? 1 / scale : 1;
    meter.add(to_double(image.rgb(t.x, t.y)) * share, t.truth.radiance * share);
  }
  return meter.result();
}

namespace {

bool any_ordered(const EnvironmentMapsParameters& parameters) {
  return std::any_of(parameters.layouts.begin(), parameters.layouts.end(),
                     [](const auto& order) { return order.has_value(); });
}

void order_layouts(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
                   MapsOutputs* outputs) {
  for (size_t product = 0; product < kLayoutProducts; ++product) {
    const std::optional<LayoutOutput>& order = parameters.layouts[product];
    if (!order) continue;
    outputs->push_back(std::make_unique<LayoutImage>(product, *order, light.environment(), target));
  }
}

}  // namespace

const MapsProduct kLayoutsProduct = {"layouts", "The map is ordered in other layouts.", true,
                                     any_ordered, order_layouts};

}  // namespace lightkiln

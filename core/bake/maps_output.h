#pragma once

// One output of an environment_maps bake, and the table of products that order them. A product has
// a file of its own, maps_<product>.cpp; the bake knows it by its row in maps_products() alone.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/bake/kitchen.h"
#include "core/bake/maps_light.h"

namespace lightkiln {

// What an output needs of the map's coefficients.
struct SpectrumNeed {
  ShNeed sh = {};                  // as coefficients
  const LobePlan* lobe = nullptr;  // those of a convolution, as exact as its responses ask
};

// What outputs file what they made in.
struct MapsResult {
  Assembly assembly;
  EnvironmentDocument document;                      // becomes the assembly's
  int threads = 1;                                   // to encode images on
  FaceOrientation faces = FaceOrientation::openexr;  // of every cube that is filed
};

class MapsOutput {
 public:
  virtual ~MapsOutput() = default;

  // Stated before the work starts, in the unit of target_error: relative rms over the sphere.
  virtual double error_bound() const = 0;
  // False: nothing can be promised before the work, error_bound() is 0, and what make() measures
  // stands in its place.
  virtual bool bounded() const { return true; }
  virtual SpectrumNeed spectrum_need() const { return {}; }
  // CPU seconds on the model's core (maps_cost.h) beside those of the shared coefficients.
  virtual double model_seconds(MapsLight& light) const = 0;
  // The same of holding one texel against the twin, where that is not a pass over the map.
  virtual double check_seconds(MapsLight&) const { return 0; }
  // Of what the ordered form cannot hold, for the plan; "" = nothing.
  virtual std::string warning(MapsLight&) const { return {}; }
  // Writes the output's values: a pure function of spec and inputs. `check_texels` of them (texels,
  // coefficients or entries) are held against a slow double-precision twin; the result says by how
  // much they differ. 0 = none.
  virtual MeasuredError make(MapsLight& light, int check_texels, ByteWriter& writer,
                             Progress& progress) const = 0;
  // Reads what make() wrote and files it as artifacts and in the document.
  virtual void file(ByteReader& reader, const MeasuredError& measured,
                    MapsResult* result) const = 0;
};

using MapsOutputs = std::vector<std::unique_ptr<MapsOutput>>;

struct MapsProduct {
  const char* name;    // the group of parameters that orders it, and its effect
  const char* reason;  // for the plan, when it is ordered
  bool depends_on_light;
  bool (*ordered)(const EnvironmentMapsParameters& parameters);
  // Appends its outputs, made to an error of `target` (a bound, see working_target()).
  void (*order)(const EnvironmentMapsParameters& parameters, MapsLight& light, double target,
                MapsOutputs* outputs);
  // What the plan says instead of `reason` when the product is ordered; null = nothing else.
  Effect (*effect)(const MapsLight& light) = nullptr;
};

// In the order of elements.
std::span<const MapsProduct> maps_products();

MapsOutputs order_outputs(const EnvironmentMapsParameters& parameters, MapsLight& light,
                          double target);

// What the outputs need of the map's coefficients together.
std::vector<LobePlan> lobes_of(const MapsOutputs& outputs);
ShNeed sh_need_of(const MapsOutputs& outputs);
void require_spectrum(const MapsOutputs& outputs, MapsLight* light);

// What is to be taken out of the map before any output is made; none when no sun is ordered.
std::optional<SunOptions> sun_options(const EnvironmentMapsParameters& parameters);

// The bound that an order of `target_error` is baked to. A bound is an rms over the sphere; a tenth
// of the order leaves room for the single texel.
double working_target(double target_error);
// The order behind it.
double ordered_error(double working_target);

// The i-th of `count` indices below `all` to hold against a twin: spread evenly at any count, by
// the golden ratio.
size_t check_index(int i, size_t all);

// Differences relative to `scale`, gathered one by one, from truths that err by `twin` at most.
// Their rms is that of the channel where it is largest, as a bound counts it.
class ErrorMeter {
 public:
  explicit ErrorMeter(double scale, double twin = 0) : scale_(scale) {
    measured_.twin = scale > 0 ? twin / scale : twin;
  }
  void add(const Vec3d& value, const Vec3d& truth);
  MeasuredError result() const;

 private:
  double scale_;
  MeasuredError measured_;
  Vec3d squares_;
};

// Enters an output into the books. It counts with the larger of what was promised and what was
// seen; one whose texels err by more than the order, against what its bound says and beyond what
// the twin may err by, is suspicious.
void judge_output(double bound, const MeasuredError& measured, double target, ChunkReport* report,
                  Round* round);

// Adds a cube as six faces in one strip, turned as ordered, with text attributes saying so.
void add_cube(const std::string& name, Image cube, std::map<std::string, std::string> attributes,
              MapsResult* result);
// All levels of a chain in one file.
void add_mip_mapped_cube(const std::string& name, std::vector<Image> levels,
                         std::map<std::string, std::string> attributes, MapsResult* result);

extern const MapsProduct kSunProduct;
extern const MapsProduct kShProduct;
extern const MapsProduct kIrradianceProduct;
extern const MapsProduct kPrefilterProduct;
extern const MapsProduct kSheenProduct;
extern const MapsProduct kDfgProduct;
extern const MapsProduct kSpectrumProduct;
extern const MapsProduct kAssetProduct;
extern const MapsProduct kLayoutsProduct;
extern const MapsProduct kLightSetProduct;

}  // namespace lightkiln

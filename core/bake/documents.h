#pragma once

// What a bake says of its artifacts: documents that the service writes as JSON; core knows no JSON.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/bake/accuracy.h"
#include "core/environment/light_set.h"
#include "core/environment/lookup_cube.h"
#include "core/environment/round_trip.h"
#include "core/environment/sun_extraction.h"
#include "core/image/image.h"
#include "core/sphere/harmonic_exports.h"
#include "core/sphere/harmonic_spectrum.h"
#include "core/sphere/harmonic_window.h"
#include "core/sphere/harmonics.h"
#include "core/sphere/map_layout.h"
#include "core/sphere/rotation.h"
#include "core/sphere/zh3.h"

namespace lightkiln {

struct AoMeshIndex {
  std::string name;
  int node = -1, mesh = -1, primitive = -1;
  uint64_t first = 0;  // into the strip, in vertices
  uint64_t count = 0;
  double mean = 0, min = 0, max = 0;
  // Vertices whose error bar cannot be trusted, and vertices that ran out of samples above the
  // ordered error.
  uint64_t suspicious = 0, budget_limited = 0;
};
struct AoDocument {
  std::vector<AoMeshIndex> meshes;
  uint64_t vertices = 0;
  double mean = 0, min = 0, max = 0;
  double error_rms = 0, error_max = 0;
  uint64_t suspicious = 0, budget_limited = 0;  // summed over meshes
  int strip_width = 0, strip_height = 0;        // pixel i of the EXR strip is vertex i, row by row
};

// Six directions with the RGB that evaluating the coefficients there must give, so that an importer
// can prove itself.
struct ShSelftest {
  Vec3d direction;
  Vec3d radiance;
  Vec3d irradiance;
};
struct ShDocument {
  ShRgb sh;
  std::vector<ShSelftest> selftest;
  double error = 0;  // bound or 95 % half-width, relative to L00
};
std::vector<ShSelftest> make_selftest(const ShRgb& sh);

// What an output differs by from a slow double-precision twin, on a sample of its texels,
// coefficients or entries; in the unit of its bound.
struct MeasuredError {
  uint64_t count = 0;       // how many were compared; 0 = none
  double rms = 0, max = 0;  // of colours: of the channel that errs most
  double twin = 0;          // what the twin itself may err by; 0 = nothing that counts
};
// An image that a map was turned into.
struct MapDocument {
  std::string artifact;
  int size = 0;
  double roughness = 0;    // of a prefiltered level
  double error_bound = 0;  // rms over the sphere, relative to the output's mean; DFG: absolute
  MeasuredError measured;
  int level = 0;                                     // of a chain; in a mip-mapped file its place
  FaceOrientation faces = FaceOrientation::openexr;  // of cubes
};
// Irradiance of the first bands alone differs from the whole by this much of its mean.
struct IrradianceDocument : MapDocument {
  std::optional<int> bands;  // none = all
  double omitted_rms = 0, omitted_most = 0;
};
struct DfgDocument : MapDocument {
  bool multiple_scattering = false;
  bool charlie = false;
};
struct SpectrumDocument {
  ShSpectrum spectrum;             // of as many bands as can be ordered
  int rows = 0;                    // of them, those that were asked for
  BandAdvice ordered;              // for the error that was ordered
  std::vector<BandAdvice> quoted;  // for the errors that every plan prices
  double error_bound = 0;          // of a coefficient, relative to L00
  MeasuredError measured;
};
// A glTF asset that lights a scene by the map, and what its 8-bit images changed.
struct AssetLevelDocument {
  int size = 0;
  double roughness = 0;
  double error_bound = 0;  // before packing; as of MapDocument
  MeasuredError measured;  // before packing
  // Of packing, relative to the map's mean luminance; what the format cannot hold is cut.
  double packing_rms = 0, packing_max = 0;
  uint64_t cut_texels = 0;
  double cut_share = 0;  // of the level's light
};
struct AssetDocument {
  std::string artifact;
  std::vector<AssetLevelDocument> levels;
  std::optional<ShWindowReport> sh_window;  // of its coefficients, of a window other than none
};
// The map in another layout.
struct LayoutDocument {
  std::string name;                                  // as ordered: "octahedral"
  std::vector<std::string> artifacts;                // one; of cube_faces six, +X -X +Y -Y +Z -Z
  MapLayout layout;                                  // of cube_faces: the strip of its faces
  FaceOrientation faces = FaceOrientation::openexr;  // of cubes
  // Of a texel's value, relative to the source's mean or to the brightest texel that it shows,
  // whichever is more: rms. 0 where texels are only moved.
  double error_bound = 0;
  MeasuredError measured;
  std::optional<RoundTrip> round_trip;  // none when nothing was to be checked
};
// The irradiance that `lights` directional lights give, against the map's at 1024 normals: relative
// to the mean irradiance.
struct LightSetError {
  int lights = 0;
  double rms = 0, max = 0;
};
struct LightSetDocument {
  std::string artifact;
  std::vector<DirectionalLight> lights;  // brightest first
  Vec3d energy;                          // the sum of their irradiances
  LightSetError error;
  std::vector<LightSetError> by_lights;  // 1, 2, 4, .. 256
};

struct EnvironmentDocument {
  MapLayout source_layout;  // of the file
  // What it was brought to a lat-long to, see SourceReading; 0 = it is one.
  double source_conversion_error = 0;
  double source_covered_share = 1;  // of the sphere; the rest was taken as black
  Rotation rotation;
  int source_width = 0, source_height = 0;
  std::string source_format;
  PixelRepairs repairs;
  Vec3d mean;
  double max_luminance = 0;
  FaceOrientation faces = FaceOrientation::openexr;  // of every cube below
  std::optional<ShDocument> sh;
  MeasuredError sh_measured;
  std::optional<ShWindowReport> sh_window;  // of a window other than none
  std::optional<Zh3> zh3;
  std::vector<ShExport> sh_exports;
  std::optional<SpectrumDocument> spectrum;
  std::vector<LayoutDocument> layouts;
  std::optional<IrradianceDocument> irradiance;
  std::vector<MapDocument> prefilter, sheen;  // levels as ordered
  std::optional<DfgDocument> dfg;
  std::optional<AssetDocument> asset;
  std::optional<SunExtraction> sun;  // found or not, when it was ordered
  std::string sun_artifact;          // "" = none was found
  ShRgb sun_sh;                      // of the disk
  MeasuredError sun_measured;        // of energy, relative to the map's
  std::optional<LightSetDocument> light_set;
};

enum class ProbeStatus { valid, inside_geometry, on_surface };
const char* probe_status_name(ProbeStatus status);
struct ProbeDocument {
  uint64_t index = 0;
  Vec3d position;
  ProbeStatus status = ProbeStatus::valid;
  double backface_share = 0;  // share of nearest hits that meet a back face
  double distance_mean = 0;   // world units, over directions that hit; 0 when none does
  double distance_min = 0;
  double hit_share = 0;
  // 95 % bound on the root mean square over the sphere of the texels' errors of luminance, relative
  // to the job's mean luminance.
  double error = 0;
  AccuracyStatus accuracy = AccuracyStatus::converged;
  ShDocument sh;  // its error is that before the window, whose factors are at most 1
  std::optional<ShWindowReport> sh_window;  // of a window other than none
  std::string radiance_artifact;
  std::string distance_artifact;
};
struct ProbesDocument {
  std::vector<ProbeDocument> probes;
  int cubemap_size = 0;
  FaceOrientation faces = FaceOrientation::openexr;  // of every cube
};

}  // namespace lightkiln

// Cubes as graphics interfaces look them up, ordered through the front door.

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/image/exr.h"
#include "core/sphere/direction_map.h"
#include "tests/bake/maps_orders.h"

namespace lightkiln {
namespace {

using test::document_of;
using test::exr_of;

constexpr int kSide = 8;
const std::string kFaces[] = {"px", "nx", "py", "ny", "pz", "nz"};

Image read(const Assembly& result, const std::string& name) {
  for (const Artifact& artifact : result.artifacts) {
    if (artifact.name == name) return read_exr(artifact.bytes).image;
  }
  ADD_FAILURE() << "There is no " << name;
  return Image(kSide, 6 * kSide, 3);
}

const std::vector<std::byte>& bytes_of(const Assembly& result, const std::string& name) {
  const auto found = std::find_if(result.artifacts.begin(), result.artifacts.end(),
                                  [&](const Artifact& a) { return a.name == name; });
  if (found == result.artifacts.end()) throw std::runtime_error("no artifact " + name);
  return found->bytes;
}

// What lies at d is told by its colour.
Vec3d colour_of(const Vec3d& d) {
  return Vec3d{0.5, 0.5, 0.5} + d * 0.4;
}
std::vector<std::byte> sky_of_directions() {
  Image map(64, 32, 3);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      // Centre +Z, +X a quarter left of it, top row +Y.
      const double longitude = kPi * (1 - (x + 0.5) / 32), latitude = kPi * (0.5 - (y + 0.5) / 32);
      const Vec3 rgb =
          to_float(colour_of({std::cos(latitude) * std::sin(longitude), std::sin(latitude),
                              std::cos(latitude) * std::cos(longitude)}));
      std::copy_n(&rgb.x, 3, map.at(x, y));
    }
  }
  return exr_of(map);
}

// A cube no texel of which is another's.
Image numbered_strip() {
  Image strip(kSide, 6 * kSide, 3);
  for (size_t i = 0; i < strip.pixels.size(); ++i) strip.pixels[i] = 0.25f + float(i);
  return strip;
}

LayoutOutput sized(int size, TexelConvention convention = TexelConvention::half_texel) {
  LayoutOutput output;
  output.size = size;
  output.texel_convention = convention;
  return output;
}

constexpr auto kStrip = size_t(LayoutKind::cube_strip);
constexpr auto kHorizontal = size_t(LayoutKind::horizontal_cross);
constexpr auto kVertical = size_t(LayoutKind::vertical_cross);

EnvironmentMapsParameters every_cube(FaceOrientation orientation) {
  EnvironmentMapsParameters parameters;
  parameters.cubes.face_orientation = orientation;
  for (const size_t product : {kStrip, kHorizontal, kVertical, kCubeFaces})
    parameters.layouts[product] = sized(kSide);
  parameters.layouts[size_t(LayoutKind::latlong)] = sized(32, TexelConvention::openexr);
  parameters.irradiance = IrradianceOutput{kSide};
  parameters.prefilter = PrefilterOutput{8, 3};
  parameters.sheen = PrefilterOutput{8, 2, RoughnessScale::custom, {0.5, 1}, Packaging::mip_mapped};
  parameters.dfg = DfgOutput{8};
  return parameters;
}

const std::set<std::string> kStrips = {"layout_cube_strip.exr", "irradiance.exr",
                                       "prefilter_0.exr",       "prefilter_1.exr",
                                       "prefilter_2.exr",       "sheen.exr"};

Assembly bake(const EnvironmentMapsParameters& parameters, const std::vector<std::byte>& file,
              Plan* plan = nullptr) {
  const Spec spec = test::order(parameters);
  for (const SpecFault& fault : validate(spec)) ADD_FAILURE() << fault.pointer << fault.message;
  return test::bake(spec, file, 1, plan);
}

// That order of the sky of directions, made once.
const Assembly& baked(FaceOrientation orientation) {
  const auto make = [](FaceOrientation o) { return bake(every_cube(o), sky_of_directions()); };
  static const Assembly ours = make(FaceOrientation::openexr);
  static const Assembly theirs = make(FaceOrientation::opengl);
  return orientation == FaceOrientation::opengl ? theirs : ours;
}

// Khronos Group, OpenGL 4.6 core profile, table 8.19: the face of the major axis of r, and with its
// sc, tc and ma the coordinates s = (sc / |ma| + 1) / 2, t = (tc / |ma| + 1) / 2.
struct LookUp {
  int face = 0;
  double s = 0, t = 0;
};
LookUp look_up(const Vec3d& r) {
  const double x = std::abs(r.x), y = std::abs(r.y), z = std::abs(r.z);
  int face = 0;
  double sc = 0, tc = 0, ma = 0;
  if (x >= y && x >= z) {
    face = r.x > 0 ? 0 : 1, ma = x, sc = r.x > 0 ? -r.z : r.z, tc = -r.y;
  } else if (y >= z) {
    face = r.y > 0 ? 2 : 3, ma = y, sc = r.x, tc = r.y > 0 ? r.z : -r.z;
  } else {
    face = r.z > 0 ? 4 : 5, ma = z, sc = r.z > 0 ? r.x : -r.x, tc = -r.y;
  }
  return {face, (sc / ma + 1) / 2, (tc / ma + 1) / 2};
}

// What a sampler that does not interpolate gives for r. Row 0 of an image has t = 0.
Vec3 sample(const Image& strip, const Vec3d& r) {
  const int size = strip.width;
  const LookUp at = look_up(r);
  return strip.rgb(std::min(int(at.s * size), size - 1),
                   at.face * size + std::min(int(at.t * size), size - 1));
}

TEST(CubeOrientation, OpenglFacesAnswerTheLookupOfGraphicsInterfaces) {
  const Assembly& ours = baked(FaceOrientation::openexr);
  const Assembly& theirs = baked(FaceOrientation::opengl);
  for (const std::string& name : kStrips) {
    const Image before = read(ours, name), after = read(theirs, name);
    ASSERT_EQ(before.pixels.size(), after.pixels.size());
    int wrong = 0, same_place = 0;
    for (int line = 0; line < before.height; ++line) {
      for (int x = 0; x < before.width; ++x) {
        const int size = before.width;
        const Vec3d d = cube_texel_direction(line / size, x, line % size, size);
        wrong += sample(after, {-d.x, d.y, d.z}) != before.rgb(x, line);
        same_place += after.rgb(x, line) == before.rgb(x, line);
      }
    }
    EXPECT_EQ(wrong, 0) << name;
    EXPECT_LT(same_place, before.width * before.height / 2) << name;
  }
  // Against the sky itself, with nothing of ours between; half a texel of 8 is 0.1 in a colour.
  const Image strip = read(theirs, "layout_cube_strip.exr");
  double mirrored = 0;
  for (int i = 0; i < 500; ++i) {
    const double z = 1 - (2 * i + 1) / 500.0, turn = 2.399963 * i, r = std::sqrt(1 - z * z);
    const Vec3d d = {r * std::cos(turn), r * std::sin(turn), z};
    const Vec3d seen = to_double(sample(strip, {-d.x, d.y, d.z}));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen[c], colour_of(d)[c], 0.1) << i;
    mirrored = std::max(mirrored, std::abs(sample(strip, d).x - colour_of(d).x));
  }
  EXPECT_GT(mirrored, 0.5);  // looked up in our world, left and right are exchanged
}

TEST(CubeOrientation, ALevelOfAMipMappedFileIsTurnedAsEveryOther) {
  const auto levels = [](FaceOrientation orientation) {
    return read_exr_levels(bytes_of(baked(orientation), "sheen.exr"));
  };
  const auto ours = levels(FaceOrientation::openexr), theirs = levels(FaceOrientation::opengl);
  ASSERT_EQ(ours.size(), theirs.size());
  for (size_t level = 0; level < 2; ++level)
    EXPECT_EQ(strip_to_opengl(ours[level]).pixels, theirs[level].pixels) << level;
}

TEST(CubeOrientation, SixFilesAreTheFacesOfTheStrip) {
  const Assembly& result = baked(FaceOrientation::opengl);
  const Image strip = read(result, "layout_cube_strip.exr");
  for (int face = 0; face < 6; ++face) {
    const Image part = read(result, "layout_cube_faces_" + kFaces[face] + ".exr");
    EXPECT_TRUE(std::equal(part.pixels.begin(), part.pixels.end(), strip.at(0, face * kSide)))
        << kFaces[face];
  }
}

// A face cut out of a picture, half turned or not.
void expect_square(const Image& cross, int column, int row, bool turned, const Image& strip,
                   int face) {
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int i = turned ? kSide - 1 - x : x, j = turned ? kSide - 1 - y : y;
      ASSERT_EQ(cross.rgb(column * kSide + i, row * kSide + j), strip.rgb(x, face * kSide + y))
          << kFaces[face];
    }
  }
}

TEST(CubeOrientation, CrossesAreOpenglsFacesUnfoldedInEitherOrientation) {
  const Assembly& ours = baked(FaceOrientation::openexr);
  const Assembly& theirs = baked(FaceOrientation::opengl);
  const Image strip = read(theirs, "layout_cube_strip.exr");
  const Image across = read(theirs, "layout_horizontal_cross.exr");
  const Image down = read(theirs, "layout_vertical_cross.exr");
  EXPECT_EQ(across.pixels, read(ours, "layout_horizontal_cross.exr").pixels);
  EXPECT_EQ(down.pixels, read(ours, "layout_vertical_cross.exr").pixels);
  // Where OpenGL's tools cut: -X +Z +X -Z from the left, +Y above +Z and -Y below it.
  const int row[6][2] = {{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {3, 1}};
  const int column[6][2] = {{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {1, 3}};
  for (int face = 0; face < 6; ++face) {
    expect_square(across, row[face][0], row[face][1], false, strip, face);
    expect_square(down, column[face][0], column[face][1], face == 5, strip, face);
  }
}

// Files of a default order say nothing of it, and are what they were.
TEST(CubeOrientation, FilesSayHowTheirFacesAreTurned) {
  const Assembly& ours = baked(FaceOrientation::openexr);
  const Assembly& theirs = baked(FaceOrientation::opengl);
  ASSERT_EQ(theirs.artifacts.size(), ours.artifacts.size());
  for (size_t i = 0; i < ours.artifacts.size(); ++i) {
    const Artifact &a = theirs.artifacts[i], &b = ours.artifacts[i];
    const bool cube = a.name != "dfg.exr" && a.name != "layout_latlong.exr";
    EXPECT_EQ(exr_text(a.bytes, kFaceOrientationAttribute), cube ? "opengl" : "") << a.name;
    EXPECT_EQ(exr_text(b.bytes, kFaceOrientationAttribute), "") << a.name;
    EXPECT_EQ(a.bytes == b.bytes, !cube) << a.name;
    if (!cube) continue;
    const std::string mark = "(-x, y, z)";
    EXPECT_NE(exr_text(a.bytes, "lightkiln.layout").find(mark), std::string::npos) << a.name;
    EXPECT_EQ(exr_text(b.bytes, "lightkiln.layout").find(mark), std::string::npos) << a.name;
  }
}

// OpenEXR's attribute claims its orientation with its texel centres; those alone are told in words.
TEST(CubeOrientation, NoEnvmapAttributeStandsOnAFileInOpenglsOrientation) {
  EnvironmentMapsParameters parameters;
  parameters.layouts[kStrip] = sized(kSide, TexelConvention::openexr);
  parameters.layouts[size_t(LayoutKind::latlong)] = sized(32, TexelConvention::openexr);
  const Assembly ours = bake(parameters, sky_of_directions());
  parameters.cubes.face_orientation = FaceOrientation::opengl;
  const Assembly theirs = bake(parameters, sky_of_directions());
  const auto strip = [](const Assembly& a) { return bytes_of(a, "layout_cube_strip.exr"); };
  EXPECT_EQ(read_exr(strip(ours)).envmap, EnvmapAttribute::cube);
  EXPECT_EQ(read_exr(strip(theirs)).envmap, EnvmapAttribute::none);
  const std::string convention = exr_text(strip(theirs), "lightkiln.texel_convention");
  EXPECT_EQ(convention.rfind("openexr", 0), 0u) << convention;
  EXPECT_EQ(convention, exr_text(strip(ours), "lightkiln.texel_convention"));
  EXPECT_EQ(bytes_of(theirs, "layout_latlong.exr"), bytes_of(ours, "layout_latlong.exr"));
}

TEST(CubeOrientation, DocumentsSayItAndChecksHoldTheSameTexels) {
  const Assembly& ours = baked(FaceOrientation::openexr);
  const Assembly& theirs = baked(FaceOrientation::opengl);
  const EnvironmentDocument &a = document_of(ours), &b = document_of(theirs);
  EXPECT_EQ(a.faces, FaceOrientation::openexr);
  EXPECT_EQ(b.faces, FaceOrientation::opengl);
  EXPECT_EQ(b.irradiance->faces, FaceOrientation::opengl);
  EXPECT_EQ(b.dfg->faces, FaceOrientation::openexr);
  const auto expect_same = [](const MeasuredError& one, const MeasuredError& other) {
    EXPECT_EQ(one.count, other.count);
    EXPECT_EQ(one.rms, other.rms);
    EXPECT_EQ(one.max, other.max);
    EXPECT_LT(one.max, 1e-3);
  };
  expect_same(a.irradiance->measured, b.irradiance->measured);
  for (size_t level = 0; level < 3; ++level) {
    EXPECT_EQ(b.prefilter[level].faces, FaceOrientation::opengl);
    EXPECT_GT(b.prefilter[level].measured.count, 0u);
    expect_same(a.prefilter[level].measured, b.prefilter[level].measured);
  }
  ASSERT_EQ(a.layouts.size(), b.layouts.size());
  for (size_t i = 0; i < a.layouts.size(); ++i) {
    const bool cube = b.layouts[i].name != "latlong";
    EXPECT_EQ(b.layouts[i].faces == FaceOrientation::opengl, cube) << b.layouts[i].name;
    expect_same(a.layouts[i].measured, b.layouts[i].measured);
  }
  EXPECT_EQ(theirs.accuracy.status, AccuracyStatus::exact);
}

TEST(CubeOrientation, AStripComesBackToTheBit) {
  const Image strip = numbered_strip();
  for (const TexelConvention convention : {TexelConvention::half_texel, TexelConvention::openexr}) {
    EnvironmentMapsParameters parameters;
    parameters.source.layout = LayoutKind::cube_strip;
    parameters.source.texel_convention = convention;
    parameters.layouts[kStrip] = sized(kSide, convention);
    parameters.cubes.face_orientation = FaceOrientation::opengl;
    const Assembly out = bake(parameters, exr_of(strip));
    const std::vector<std::byte>& file = bytes_of(out, "layout_cube_strip.exr");
    EXPECT_NE(read_exr(file).image.pixels, strip.pixels);
    parameters.cubes = {};
    parameters.source.face_orientation = FaceOrientation::opengl;
    const Assembly back = bake(parameters, file);
    EXPECT_EQ(read(back, "layout_cube_strip.exr").pixels, strip.pixels);
  }
}

TEST(CubeOrientation, SixFilesAndCrossesComeBackToTheBit) {
  const Image strip = numbered_strip();
  EnvironmentMapsParameters parameters;
  parameters.source.layout = LayoutKind::cube_strip;
  parameters.layouts[kCubeFaces] = parameters.layouts[kHorizontal] = parameters.layouts[kVertical] =
      sized(kSide);
  parameters.cubes.face_orientation = FaceOrientation::opengl;
  const Assembly out = bake(parameters, exr_of(strip));

  EnvironmentMapsParameters wanted;
  wanted.source.face_orientation = FaceOrientation::opengl;
  wanted.layouts[kStrip] = sized(kSide);
  Spec spec = test::order(wanted);
  spec.environment = InputRef{};
  Inputs inputs;
  for (size_t face = 0; face < 6; ++face) {
    spec.environment->faces.push_back("sha256:" + std::string(64, static_cast<char>('a' + face)));
    inputs.blobs[spec.environment->faces[face]] =
        bytes_of(out, "layout_cube_faces_" + kFaces[face] + ".exr");
  }
  EXPECT_TRUE(validate(spec).empty());
  Progress progress;
  Plan plan;
  const Assembly back = bake_all(spec, inputs, {1, 0, 1}, progress, &plan);
  EXPECT_EQ(read(back, "layout_cube_strip.exr").pixels, strip.pixels);
  EXPECT_TRUE(plan.warnings.empty());

  for (const LayoutKind kind : {LayoutKind::horizontal_cross, LayoutKind::vertical_cross}) {
    wanted.source.layout = kind;
    const auto& file = bytes_of(out, std::string("layout_") + layout_name(kind) + ".exr");
    EXPECT_EQ(read(bake(wanted, file), "layout_cube_strip.exr").pixels, strip.pixels);
  }
}

TEST(CubeOrientation, AFileReadAgainstWhatItSaysIsWarnedOf) {
  EnvironmentMapsParameters parameters;
  parameters.source.layout = LayoutKind::cube_strip;
  parameters.layouts[kStrip] = sized(kSide);
  parameters.cubes.face_orientation = FaceOrientation::opengl;
  Plan plan;
  const Assembly out = bake(parameters, exr_of(numbered_strip()), &plan);
  EXPECT_TRUE(plan.warnings.empty());
  bake(parameters, bytes_of(out, "layout_cube_strip.exr"), &plan);
  ASSERT_EQ(plan.warnings.size(), 1u);
  EXPECT_NE(plan.warnings[0].find("turned as opengl"), std::string::npos) << plan.warnings[0];
  parameters.source.face_orientation = FaceOrientation::opengl;
  bake(parameters, bytes_of(out, "layout_cube_strip.exr"), &plan);
  EXPECT_TRUE(plan.warnings.empty());
}

TEST(CubeOrientation, IsRefusedWhereThereIsNoCube) {
  const auto pointers = [](const EnvironmentMapsParameters& parameters) {
    std::vector<std::string> found;
    for (const SpecFault& fault : validate(test::order(parameters)))
      found.push_back(fault.pointer + " " + fault.code);
    return found;
  };
  using Found = std::vector<std::string>;
  EnvironmentMapsParameters parameters;
  parameters.cubes.face_orientation = FaceOrientation::opengl;
  parameters.sh = ShOutput{};
  parameters.asset = AssetOutput{32};  // whose own format says how its faces are turned
  parameters.layouts[size_t(LayoutKind::octahedral)] = sized(16);
  EXPECT_EQ(pointers(parameters), Found{"/parameters/cubes/face_orientation conflict"});
  for (const size_t product : {kStrip, kHorizontal, kVertical, kCubeFaces}) {
    EnvironmentMapsParameters with = parameters;
    with.layouts[product] = sized(kSide);
    EXPECT_EQ(pointers(with), Found{}) << product;
  }
  parameters.irradiance = IrradianceOutput{};
  EXPECT_EQ(pointers(parameters), Found{});
}

}  // namespace
}  // namespace lightkiln

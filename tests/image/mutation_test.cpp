// Damaged files either decode or are refused with Error: nothing else may happen.

#include <functional>

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "core/base/error.h"
#include "core/image/decode.h"
#include "core/image/ldr.h"
#include "core/image/radiance_hdr.h"
#include "tests/image/exr_files.h"
#include "tests/image/ldr_files.h"

namespace lightkiln {
namespace {

using Bytes = std::vector<std::byte>;

Bytes mutate(Bytes bytes) {
  const int edits = *rc::gen::inRange(1, 6);
  for (int i = 0; i < edits && !bytes.empty(); ++i) {
    const auto at = *rc::gen::inRange<size_t>(0, bytes.size());
    switch (*rc::gen::inRange(0, 6)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
        break;
      case 2:
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), std::byte{0xff});
        break;
      case 3:
        bytes[at] = *rc::gen::element(std::byte{0}, std::byte{0x7f}, std::byte{0xff});
        break;
      default:
        bytes[at] = static_cast<std::byte>(*rc::gen::inRange(0, 256));
        break;
    }
  }
  return bytes;
}

void survives(const Bytes& original, const std::function<size_t(const Bytes&)>& read) {
  for (int i = 0; i < 10; ++i) {
    const Bytes bytes = mutate(original);
    try {
      RC_ASSERT(read(bytes) > 0u);
    } catch (const Error& refusal) {
      RC_ASSERT(refusal.code() == ErrorCode::invalid_input ||
                refusal.code() == ErrorCode::unsupported || refusal.code() == ErrorCode::too_large);
    }
  }
}

size_t read_hdr(const Bytes& bytes) {
  return decode_hdr_image(bytes).image.pixels.size();
}

RC_GTEST_PROP(Mutation, OpenExrDecodesOrIsRefused, ()) {
  test::ExrRecipe recipe;
  recipe.compression = *rc::gen::element<std::string>("none", "rle", "zips", "zip", "piz", "pxr24",
                                                      "b44", "b44a", "dwaa", "dwab");
  recipe.samples = *rc::gen::element(test::ExrSamples::half, test::ExrSamples::float32,
                                     test::ExrSamples::uint32);
  recipe.storage = *rc::gen::element(test::ExrStorage::scan_lines, test::ExrStorage::tiles,
                                     test::ExrStorage::mip_map);
  recipe.second_part =
      recipe.storage == test::ExrStorage::scan_lines && *rc::gen::arbitrary<bool>();
  survives(
      test::make_exr(test::ramp(*rc::gen::inRange(1, 40), *rc::gen::inRange(1, 40), 3), recipe),
      read_hdr);
}

RC_GTEST_PROP(Mutation, LuminanceChromaDecodesOrIsRefused, ()) {
  test::ChromaRecipe recipe;
  recipe.second_part = *rc::gen::arbitrary<bool>();
  survives(test::make_luminance_chroma_exr(test::ramp(32, 24, 3), recipe), read_hdr);
}

RC_GTEST_PROP(Mutation, RadianceDecodesOrIsRefused, ()) {
  const int width = *rc::gen::inRange(1, 40);
  survives(write_radiance_hdr(test::ramp(width, 5, 3)), read_hdr);
}

RC_GTEST_PROP(Mutation, PngDecodesOrIsRefused, ()) {
  const Bytes png = write_png(test::pattern8(20, 20, *rc::gen::inRange(1, 5)));
  survives(png, [](const Bytes& bytes) { return read_ldr(bytes).pixels.size(); });
}

RC_GTEST_PROP(Mutation, JpegDecodesOrIsRefused, ()) {
  survives(test::make_jpeg(test::pattern8(24, 24, 3)),
           [](const Bytes& bytes) { return read_ldr(bytes).pixels.size(); });
}

}  // namespace
}  // namespace lightkiln

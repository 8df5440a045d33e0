#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <span>

#include "core/environment/lookup_cube.h"
#include "core/image/decode.h"
#include "core/image/ldr.h"
#include "server/cli/commands/commands.h"

namespace lightkiln::cli {

ExitCode view(const Arguments& arguments) {
  std::ifstream in(arguments.target, std::ios::binary);
  if (!in || std::filesystem::is_directory(arguments.target))
    usage_error("The image " + arguments.target + " cannot be read.");
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  DecodedImage decoded = decode_hdr_image(std::as_bytes(std::span(bytes)));
  const std::string faces = exr_text(std::as_bytes(std::span(bytes)), kFaceOrientationAttribute);
  if (faces == face_orientation_name(FaceOrientation::opengl))
    std::cerr << "kiln: The faces are shown as OpenGL looks them up, in the world (-x, y, z): +X "
                 "shows what lies at -X.\n";
  const PixelRepairs repairs = sanitise(decoded.image);
  if (repairs.nan + repairs.infinite + repairs.negative > 0)
    std::cerr << "kiln: Shown as black: " << repairs.nan << " NaN, " << repairs.infinite
              << " infinite and " << repairs.negative << " negative values.\n";
  const std::vector<std::byte> png =
      write_png(tonemap(decoded.image, TonemapOptions{arguments.exposure_stops}));
  std::ofstream out(arguments.output, std::ios::binary);
  out.write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  out.close();
  if (!out) usage_error("The file " + arguments.output + " cannot be written.");
  return kSucceeded;
}

}  // namespace lightkiln::cli

#pragma once

// Which part of an OpenEXR file is read, and what its header says of it. Included by exr_*.cpp
// only.

#include <optional>
#include <string>

#include <ImfHeader.h>
#include <ImfMultiPartInputFile.h>

#include "core/image/exr.h"
#include "core/image/exr_chunks.h"
#include "core/image/primaries.h"

namespace lightkiln {

// What the chosen part holds.
enum class ExrColors { rgb, luminance, luminance_chroma };

struct ExrPart {
  int number = 0;
  ExrColors colors = ExrColors::rgb;
};

// The first part with colours that are read here, its sampling checked. Throws Error{unsupported}:
// deep, or without such channels (which are listed), or subsampled otherwise than 2 x 2 chroma.
ExrPart choose_exr_part(const Imf::MultiPartInputFile& file);

// The layout of part n, once everything is checked that decides how much memory the decoder takes.
// Throws Error: too_large, or unsupported for an unknown compression.
ExrLayout exr_layout(const Imf::MultiPartInputFile& file, int n);

// Rec. 709 when the header states none.
Primaries exr_primaries(const Imf::Header& header);

// Throws Error{invalid_input} for a value that OpenEXR does not know.
EnvmapAttribute exr_envmap(const Imf::Header& header);

// The display window from the data window's corner; none when they are the same.
std::optional<PixelWindow> exr_display(const Imf::Header& header);

// "OpenEXR, 16-bit float, ZIP, tiled", for reports.
std::string exr_format(const Imf::Header& header, ExrColors colors);

}  // namespace lightkiln

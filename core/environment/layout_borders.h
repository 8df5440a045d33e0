#pragma once

// Texels that repeat a direction, in the openexr convention.

#include "core/base/progress.h"
#include "core/environment/layout_gather.h"

namespace lightkiln {

// Fills the border texels of a block: each is the mean over all parts of its cell, which lie at
// every place that repeats it, and equal to the bit to its repetitions on other blocks.
void fill_borders(const ConversionTask& task, const TargetBlock& block, Image* image,
                  Progress& progress);

}  // namespace lightkiln

#include "core/image/exr_library.h"

#include <ImfHeader.h>
#include <ImfThreading.h>

namespace lightkiln {

bool ExrMemoryInput::read(char target[], int count) {
  if (count < 0 || position_ > bytes_.size() ||
      static_cast<size_t>(count) > bytes_.size() - position_)
    throw Iex::InputExc("the file ends too early");
  std::memcpy(target, bytes_.data() + position_, static_cast<size_t>(count));
  position_ += static_cast<size_t>(count);
  return position_ < bytes_.size();
}

void ExrMemoryOutput::write(const char source[], int count) {
  const size_t end = position_ + static_cast<size_t>(count);
  if (end > bytes.size()) bytes.resize(end);
  std::memcpy(bytes.data() + position_, source, static_cast<size_t>(count));
  position_ = end;
}

// The library's limits hold for the whole process and for writing too. They are set far above what
// read_exr allows, so that absurd headers stop before anything is allocated and merely large ones
// reach check_image_size, which says what is allowed.
void prepare_exr_library() {
  static const bool prepared = [] {
    Imf::setGlobalThreadCount(0);
    Imf::Header::setMaxImageSize(1 << 20, 1 << 20);
    Imf::Header::setMaxTileSize(1 << 20, 1 << 20);
    return true;
  }();
  static_cast<void>(prepared);
}

}  // namespace lightkiln

#include "core/image/exr_library.h"

#include <algorithm>
#include <mutex>
#include <system_error>

#include <ImfHeader.h>
#include <ImfThreading.h>

#include "core/base/parallel.h"

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

int exr_library_threads(int threads) {
  const int wanted = granted_threads(threads);
  if (wanted == 1) return 0;  // the library then starts nothing and hands nothing over
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  try {
    if (Imf::globalThreadCount() < wanted) Imf::setGlobalThreadCount(wanted);
  } catch (const std::system_error&) {
    // The system has no more threads to give. Those that started do the work.
  }
  return std::min(wanted, Imf::globalThreadCount());
}

}  // namespace lightkiln

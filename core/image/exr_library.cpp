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
  static bool exhausted = false;
  const std::lock_guard lock(mutex);
  // One at a time: where a thread fails to start among others, version 3.1.5 lets those that did
  // start go on beside an object that it has freed.
  try {
    while (!exhausted && Imf::globalThreadCount() < wanted)
      Imf::setGlobalThreadCount(Imf::globalThreadCount() + 1);
  } catch (const std::system_error&) {
    exhausted = true;  // the system has no more threads to give: those that started do the work
  }
  return std::min(wanted, Imf::globalThreadCount());
}

}  // namespace lightkiln

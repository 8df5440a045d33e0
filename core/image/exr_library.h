#pragma once

// What the readers and the writers of OpenEXR share: streams in memory, and what the library throws
// turned into our one error type. Included by exr_*.cpp only.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <vector>

#include <Iex.h>
#include <ImfIO.h>

#include "core/base/error.h"
#include "core/image/image.h"

namespace lightkiln {

class ExrMemoryInput : public Imf::IStream {
 public:
  explicit ExrMemoryInput(std::span<const std::byte> bytes) : IStream("memory"), bytes_(bytes) {}

  bool read(char target[], int count) override;
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  std::span<const std::byte> bytes_;
  uint64_t position_ = 0;  // may lie past the end: reading there throws
};

class ExrMemoryOutput : public Imf::OStream {
 public:
  ExrMemoryOutput() : OStream("memory") {}

  void write(const char source[], int count) override;
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  std::vector<std::byte> bytes;

 private:
  uint64_t position_ = 0;
};

// Sets the library's process-wide limits, once.
void prepare_exr_library();

// What the library is to be told, when it opens a file, so that it works on `threads` threads (1 =
// the caller's own, 0 = one per processor), or on as many as the system lets start. Its threads are
// the process's and stay.
int exr_library_threads(int threads);

// Runs the library; what it throws becomes Error{code} with `sentence` and the library's reason.
template <typename F>
auto with_exr_library(ErrorCode code, const std::string& sentence, F&& body) {
  prepare_exr_library();
  try {
    return body();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::out_of_memory, "There is not enough memory for the OpenEXR image.");
  } catch (const std::exception& e) {
    // The library begins with the name of the file, which is always the same here.
    const std::string text = e.what(), name = "\"memory\". ";
    const size_t at = text.find(name);
    std::string reason = at == std::string::npos ? text : text.substr(at + name.size());
    while (!reason.empty() && reason.back() == '.') reason.pop_back();
    throw Error(code, sentence + ": " + printable(reason) + ".");
  }
}

}  // namespace lightkiln

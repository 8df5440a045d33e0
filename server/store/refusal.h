#pragma once

// Why the store takes nothing more at present. Whoever retries on Error{unavailable} retries on
// these as well; clients are told which it is.

#include <string>

#include "core/base/error.h"

namespace lightkiln {

// Codes of problem documents.
inline constexpr const char* kStorageFull = "storage_full";
inline constexpr const char* kQueueFull = "queue_full";

class StoreRefusal : public Error {
 public:
  StoreRefusal(const char* problem_code, const std::string& sentence)
      : Error(ErrorCode::unavailable, sentence), problem_code_(problem_code) {}
  const char* problem_code() const { return problem_code_; }

 private:
  const char* problem_code_;
};

}  // namespace lightkiln

#include "server/cli/commands/exit_code.h"

#include "proto/client.h"

namespace lightkiln::cli {

ExitCode exit_code(const Error& error) {
  if (dynamic_cast<const DigestMismatch*>(&error)) return kDigestMismatch;
  switch (error.code()) {
    case ErrorCode::invalid_spec:
    case ErrorCode::invalid_input:
    case ErrorCode::unsupported:
    case ErrorCode::too_large:
      return kInvalidOrder;
    case ErrorCode::unauthorized:
    case ErrorCode::forbidden:
      return kUnauthorized;
    case ErrorCode::not_found:
      return kNotFound;
    case ErrorCode::unavailable:
      return kUnreachable;
    case ErrorCode::cancelled:
      return kInterrupted;
    case ErrorCode::conflict:
    case ErrorCode::timed_out:
    case ErrorCode::out_of_memory:
    case ErrorCode::internal:
      return kFailed;
  }
  return kFailed;
}

}  // namespace lightkiln::cli

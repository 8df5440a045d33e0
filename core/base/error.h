#pragma once

// The one error type. Thrown anywhere, caught at two fences only: the HTTP route wrapper and the
// worker loop (the oven sends it through its pipe). `what()` is one sentence for the client: what
// is wrong, where, and what is allowed.

#include <stdexcept>
#include <string>
#include <utility>

namespace lightkiln {

enum class ErrorCode {
  invalid_spec,   // an order that breaks the contract of its kind
  invalid_input,  // a client's file that is malformed or cannot be baked
  unsupported,    // well formed, but asks for something the engine does not do
  too_large,      // over a stated limit
  not_found,
  conflict,
  cancelled,
  timed_out,
  out_of_memory,
  unauthorized,
  forbidden,
  unavailable,  // try again later
  internal,     // our mistake; the text goes to the log, never to a client
};

// The stable name used on the wire, e.g. "invalid_input".
const char* error_code_name(ErrorCode code);

class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& sentence, std::string where = "")
      : std::runtime_error(sentence), code_(code), where_(std::move(where)) {}

  ErrorCode code() const { return code_; }
  // The place in the input: a JSON pointer into a spec or a glTF, or "" when there is none.
  const std::string& where() const { return where_; }

 private:
  ErrorCode code_;
  std::string where_;
};

}  // namespace lightkiln

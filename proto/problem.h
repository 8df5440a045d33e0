#pragma once

// What every refusal looks like on the wire: application/problem+json, RFC 9457. One table says for
// each code its HTTP status, its title and whether trying again can help.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/bake/spec.h"
#include "core/base/error.h"

namespace lightkiln {

inline constexpr const char* kProblemMediaType = "application/problem+json";

// One row of the table. The codes are the names of all ErrorCodes and those that only the HTTP
// layer can raise. `/problems/<code>` serves `meaning` as a page.
struct ProblemKind {
  const char* code;     // stable, snake_case: "invalid_spec"
  int status;           // HTTP status
  const char* title;    // short, the same for every occurrence
  bool retryable;       // the same request may succeed later
  ErrorCode error;      // what a client's code should treat it as
  const char* meaning;  // one or two sentences: what happened and what to do
};
std::span<const ProblemKind> problem_kinds();
// The row of a code; null when there is none.
const ProblemKind* find_problem_kind(std::string_view code);
const ProblemKind& problem_kind(ErrorCode code);

struct Problem {
  std::string code = "internal";
  int status = 500;
  std::string title;
  std::string detail;    // one sentence about this occurrence
  std::string instance;  // identifies the occurrence, "urn:request:..."; "" = left out
  bool retryable = false;
  std::vector<SpecFault> errors;  // every fault of a document, by JSON pointer
};

// Fills status, title and retryable from the table; `code` must stand there (Error{internal}
// otherwise).
Problem make_problem(std::string_view code, const std::string& detail,
                     const std::string& instance = "");
// The text of `internal` errors stays in the log: the client gets a sentence that says so. Where
// the error names a place it becomes the one entry of `errors`.
Problem problem_from_error(const Error& error, const std::string& instance = "");
// A document that is not JSON (one fault of code "syntax") is `malformed_json`, 400; too long or
// too deep is `too_large`, 413; anything else is `invalid_spec`, 422. `faults` is not empty.
Problem problem_from_faults(const std::vector<SpecFault>& faults, const std::string& instance = "");

std::string write_problem(const Problem& problem);
// A problem of a server. Throws Error{unavailable} when the text is not one.
Problem read_problem(std::string_view json);

}  // namespace lightkiln

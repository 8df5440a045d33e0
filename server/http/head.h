#pragma once

// The rules that a request head must keep, as pure functions of its bytes. They are stricter than
// RFC 9112 where leniency has let requests be smuggled: lines end in CRLF only, lengths are digits
// only, transfer and content codings are refused, and names that servers derive for themselves
// (REMOTE_*, LOCAL_*) cannot be sent.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "server/http/http.h"

namespace lightkiln {

struct HeadLimits {
  size_t bytes = 16 * 1024;    // of the whole head
  size_t lines = 64;           // headers and request line
  size_t request_line = 1024;  // bytes
  size_t range = 64;           // bytes of a Range header's value
};

// Why a head is refused, for a problem document.
struct HeadFault {
  int status = 400;
  std::string detail;
};

// Looks for the end of the head in what has arrived so far. Gives the head's length including the
// empty line, 0 while more is needed, or a fault as soon as one is certain.
struct HeadScan {
  size_t length = 0;
  std::optional<HeadFault> fault;
};
HeadScan scan_head(std::string_view bytes, const HeadLimits& limits);

// Parses a complete head. `head` is filled as far as parsing came; peer and request_id are the
// caller's.
std::optional<HeadFault> parse_head(std::string_view bytes, const HeadLimits& limits,
                                    HttpHead& head);

// Decodes %XX. Nothing when an escape is broken, decodes to a control byte, or the result is not
// UTF-8.
std::optional<std::string> decode_percent(std::string_view text);

// Whether text is well-formed UTF-8.
bool is_utf8(std::string_view text);

}  // namespace lightkiln

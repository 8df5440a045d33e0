#pragma once

// Conditional and partial requests, RFC 9110 sections 13 and 14, for one range of bytes.

#include <cstdint>
#include <string>
#include <string_view>

#include "server/http/http.h"

namespace lightkiln {

enum class RangeKind {
  whole,          // no range, or one that is to be ignored
  part,           // [first, last], clamped to the size
  unsatisfiable,  // 416
};
struct ByteRange {
  RangeKind kind = RangeKind::whole;
  uint64_t first = 0;
  uint64_t last = 0;  // inclusive
};
// Reads the value of a Range header against a representation of `size` bytes.
ByteRange parse_range(std::string_view value, uint64_t size);

// Whether If-None-Match names this entity tag (quotes included), by weak comparison.
bool none_match_hits(const HttpHead& head, std::string_view etag);

// 304 with the tag.
HttpReply not_modified(const std::string& etag);

// A file as a reply to GET or HEAD: honours If-None-Match, Range and If-Range, and carries ETag,
// Repr-Digest and Accept-Ranges. The digest, "sha256:<hex>", is the entity tag.
HttpReply file_reply(const HttpHead& head, FileBody file, const std::string& digest,
                     const std::string& media_type);

}  // namespace lightkiln

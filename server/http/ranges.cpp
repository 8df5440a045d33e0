#include "server/http/ranges.h"

#include <algorithm>
#include <optional>

#include "proto/messages.h"
#include "server/http/problems.h"

namespace lightkiln {

namespace {

// Digits only; more than 18 of them are more than any file has.
std::optional<uint64_t> read_digits(std::string_view text) {
  if (text.empty() ||
      !std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return std::nullopt;
  while (text.size() > 1 && text.front() == '0') text.remove_prefix(1);
  if (text.size() > 18) return UINT64_MAX;
  return std::stoull(std::string(text));
}

std::string_view trim(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

}  // namespace

ByteRange parse_range(std::string_view value, uint64_t size) {
  value = trim(value);
  if (!value.starts_with("bytes=")) return {};
  value = trim(value.substr(6));
  const size_t dash = value.find('-');
  if (dash == std::string_view::npos) return {};
  const std::string_view before = trim(value.substr(0, dash));
  const std::string_view after = trim(value.substr(dash + 1));
  const ByteRange unsatisfiable{RangeKind::unsatisfiable, 0, 0};
  if (before.empty()) {
    const auto count = read_digits(after);
    if (!count) return {};
    if (*count == 0 || size == 0) return unsatisfiable;
    return {RangeKind::part, size - std::min(*count, size), size - 1};
  }
  const auto first = read_digits(before);
  const auto last = after.empty() ? std::optional<uint64_t>(UINT64_MAX) : read_digits(after);
  if (!first || !last || *last < *first) return {};
  if (*first >= size) return unsatisfiable;
  return {RangeKind::part, *first, std::min(*last, size - 1)};
}

bool none_match_hits(const HttpHead& head, std::string_view etag) {
  const std::string* header = head.header("if-none-match");
  if (!header) return false;
  std::string_view rest = *header;
  while (!rest.empty()) {
    const size_t comma = std::min(rest.find(','), rest.size());
    std::string_view tag = trim(rest.substr(0, comma));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
    if (tag.starts_with("W/")) tag.remove_prefix(2);
    if (tag == "*" || tag == etag) return true;
  }
  return false;
}

HttpReply not_modified(const std::string& etag) {
  HttpReply reply;
  reply.status = 304;
  reply.set("ETag", etag).set("Cache-Control", "no-cache");
  return reply;
}

HttpReply file_reply(const HttpHead& head, FileBody file, const std::string& digest,
                     const std::string& media_type) {
  const std::string etag = '"' + digest + '"';
  if (none_match_hits(head, etag)) return not_modified(etag).set("Accept-Ranges", "bytes");

  ByteRange range;
  const std::string* wanted = head.header("range");
  const std::string* condition = head.header("if-range");
  // A date or a weak tag never matches: only the strong tag proves that the bytes are the same.
  if (wanted && head.method == "GET" && (!condition || *condition == etag))
    range = parse_range(*wanted, file.length);
  const std::string size = std::to_string(file.length);
  if (range.kind == RangeKind::unsatisfiable) {
    HttpReply refusal = status_reply(
        416, "The range begins beyond the end; the size is " + size + " bytes.", head.request_id);
    return refusal.set("Content-Range", "bytes */" + size);
  }
  HttpReply reply;
  reply.media_type = media_type;
  if (range.kind == RangeKind::part) {
    reply.status = 206;
    reply.set("Content-Range", "bytes " + std::to_string(range.first) + '-' +
                                   std::to_string(range.last) + '/' + size);
    file.offset += range.first;
    file.length = range.last - range.first + 1;
  }
  reply.set("ETag", etag)
      .set("Accept-Ranges", "bytes")
      .set("Repr-Digest", repr_digest(digest))
      .set("Cache-Control", "private, no-cache");
  reply.file = std::move(file);
  return reply;
}

}  // namespace lightkiln

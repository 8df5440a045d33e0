#include "server/store/job_id.h"

#include <algorithm>
#include <array>

#include <sys/random.h>

#include "core/base/error.h"

namespace lightkiln {

namespace {

constexpr char kAlphabet[] = "0123456789ABCDEFGHJKMNPQRSTVWXYZ";
constexpr int kDigits = 26;

void fill_random(void* data, size_t size) {
  if (getrandom(data, size, 0) != static_cast<ssize_t>(size))
    throw Error(ErrorCode::internal, "The kernel gave no random bytes.");
}

}  // namespace

std::string make_job_id(int64_t unix_ms, const std::string& last) {
  std::array<uint8_t, kDigits> digits{};
  fill_random(digits.data(), digits.size());
  for (uint8_t& digit : digits) digit &= 31;
  for (int i = 9; i >= 0; --i, unix_ms >>= 5)
    digits[static_cast<size_t>(i)] = static_cast<uint8_t>(unix_ms & 31);

  std::string id(kDigits, '0');
  const auto write = [&] {
    for (size_t i = 0; i < digits.size(); ++i) id[i] = kAlphabet[digits[i]];
  };
  write();
  if (id > last) return id;

  // The clock did not move on: count up from the last id, leaving the low digits random.
  for (size_t i = 0; i < 16; ++i)
    digits[i] = static_cast<uint8_t>(std::find(kAlphabet, kAlphabet + 32, last[i]) - kAlphabet);
  for (size_t i = 16; i-- > 0;) {
    if (++digits[i] < 32) break;
    digits[i] = 0;
  }
  write();
  return id;
}

std::string random_hex(int bytes) {
  std::string random(static_cast<size_t>(bytes), '\0'), text;
  fill_random(random.data(), random.size());
  for (const char c : random) {
    const auto byte = static_cast<unsigned char>(c);
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

}  // namespace lightkiln

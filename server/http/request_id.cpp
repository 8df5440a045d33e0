#include "server/http/request_id.h"

#include <atomic>
#include <cstdint>
#include <random>

namespace lightkiln {

// A counter through the finaliser of SplitMix64, a bijection: distinct counts give distinct ids.
std::string make_request_id() {
  static std::atomic<uint64_t> count = [] {
    std::random_device seed;
    return (static_cast<uint64_t>(seed()) << 32) | seed();
  }();
  uint64_t z = count.fetch_add(0x9e3779b97f4a7c15u, std::memory_order_relaxed);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  z ^= z >> 31;
  std::string id(16, '0');
  for (size_t i = 0; i < 16; ++i) id[15 - i] = "0123456789abcdef"[(z >> (4 * i)) & 15];
  return id;
}

}  // namespace lightkiln

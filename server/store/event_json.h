#pragma once

// Payloads of events: flat objects of a few numbers and texts, written in the order given.

#include <cstdint>
#include <string>
#include <string_view>

namespace lightkiln {

class EventJson {
 public:
  EventJson& text(std::string_view key, std::string_view value);
  EventJson& number(std::string_view key, double value);
  EventJson& count(std::string_view key, uint64_t value);
  std::string take();

 private:
  void key(std::string_view name);
  std::string json_ = "{";
};

}  // namespace lightkiln

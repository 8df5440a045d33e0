#include "server/worker/sandbox_policy.h"

#include <algorithm>

#include "server/oven/sandbox.h"

namespace lightkiln {

namespace {

constexpr int kGreetingMs = 10'000;

}  // namespace

std::vector<std::string> read_greeting(OvenProcess& oven, int wait_ms) {
  const std::optional<Frame> hello = oven.channel().receive(wait_ms);
  if (!hello || hello->type != FrameType::hello)
    throw Error(ErrorCode::unavailable, "The oven does not greet its worker.");
  PayloadReader reader(hello->payload);
  std::vector<std::string> missing;
  for (uint64_t left = reader.number(); left > 0; --left) missing.emplace_back(reader.text());
  reader.end();
  return missing;
}

void require_sandbox(const std::vector<std::string>& missing,
                     const std::vector<std::string>& allowed) {
  const auto allows = [&](const std::string& name) {
    return std::find(allowed.begin(), allowed.end(), name) != allowed.end();
  };
  if (allows(kAllLayers)) return;
  std::string names, meanings;
  for (const std::string& name : missing) {
    if (allows(name)) continue;
    const SandboxLayer* layer = find_sandbox_layer(name);
    names += (names.empty() ? "" : ",") + name;
    meanings += (meanings.empty() ? "" : "; ") + name;
    if (layer) meanings += std::string(" (an oven ") + layer->meaning + ")";
  }
  if (names.empty()) return;
  throw Error(ErrorCode::unavailable,
              "On this machine an oven's sandbox lacks: " + meanings +
                  ". Where something else guards the machine, allow it with "
                  "--allow-missing-sandbox " +
                  names + ".");
}

std::vector<std::string> try_sandbox(const std::string& oven_path,
                                     const std::vector<std::string>& allowed) {
  OvenProcess oven({oven_path, 0}, [] { return false; });
  std::vector<std::string> missing = read_greeting(oven, kGreetingMs);
  require_sandbox(missing, allowed);
  return missing;
}

}  // namespace lightkiln

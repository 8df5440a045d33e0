// kiln-oven: the only program that opens clients' files and traces rays. A worker starts it with a
// socket as descriptor 3; it is of no use by hand.

#include <cstdio>
#include <cstdlib>

#include "server/oven/oven.h"
#include "server/oven/sandbox.h"

namespace {

constexpr int kSocket = 3;

int usage() {
  std::fputs(
      "kiln-oven is started by kilnd worker, with a socket as descriptor 3:\n"
      "  kiln-oven MEMORY_BYTES   address space limit, 0 = none\n",
      stderr);
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return usage();
  char* end = nullptr;
  lightkiln::SandboxOptions options;
  options.memory_bytes = std::strtoull(argv[1], &end, 10);
  if (end == argv[1] || *end != '\0') return usage();
  const std::vector<std::string> missing = lightkiln::enter_sandbox(options);
  try {
    lightkiln::Channel channel{lightkiln::Descriptor(kSocket)};
    return lightkiln::serve_oven(channel, missing);
  } catch (const lightkiln::PeerGone&) {
    return 0;  // the worker has given up the job, or is no more
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kiln-oven: %s\n", error.what());
    return 1;
  }
}

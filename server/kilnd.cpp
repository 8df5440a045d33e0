// kilnd: `serve` takes orders over HTTP, `worker` bakes them.

#include <csignal>
#include <cstdio>

#include <sys/prctl.h>
#include <unistd.h>

#include "core/base/error.h"
#include "server/daemon/daemon.h"

namespace {

int work(const lightkiln::WorkerConfig& config) {
  if (config.parent_process > 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != config.parent_process) return 0;  // it ended before we asked to be told
  }
  try {
    return lightkiln::run_worker(config.options);
  } catch (const lightkiln::Error& error) {
    if (error.code() == lightkiln::ErrorCode::cancelled) return 0;  // told to stop while it started
    throw;
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const auto command = lightkiln::parse_command_line(argc, argv);
    if (const auto* config = std::get_if<lightkiln::ServeConfig>(&command))
      return lightkiln::serve(*config);
    if (const auto* config = std::get_if<lightkiln::WorkerConfig>(&command)) return work(*config);
    const auto& end = std::get<lightkiln::CommandLineEnd>(command);
    std::fputs(end.text.c_str(), end.exit_code == 0 ? stdout : stderr);
    return end.exit_code;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kilnd: %s\n", error.what());
    return 1;
  }
}

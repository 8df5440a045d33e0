#include "server/cli/commands/attention.h"

#include <csignal>

namespace lightkiln::cli {
namespace {

volatile std::sig_atomic_t interrupt_count = 0;

void count_interrupt(int) {
  interrupt_count = interrupt_count + 1;
}

void handle_interrupts(void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
}

}  // namespace

Attention::Attention(double timeout_s)
    : deadline_(std::chrono::steady_clock::now() +
                std::chrono::milliseconds(static_cast<int64_t>(timeout_s * 1000))),
      limited_(timeout_s > 0) {
  interrupt_count = 0;
  handle_interrupts(count_interrupt);
  // A server that closes while it is written to is an error of that call, not the end of kiln.
  std::signal(SIGPIPE, SIG_IGN);
}

Attention::~Attention() {
  handle_interrupts(SIG_DFL);
}

int Attention::interrupts() {
  return interrupt_count;
}

bool Attention::timed_out() const {
  return limited_ && std::chrono::steady_clock::now() >= deadline_;
}

}  // namespace lightkiln::cli

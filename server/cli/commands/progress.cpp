#include "server/cli/commands/progress.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>

#include <sys/ioctl.h>
#include <unistd.h>

#include "server/cli/commands/text.h"

namespace lightkiln::cli {
namespace {

constexpr auto kPlainInterval = std::chrono::seconds(30);
constexpr size_t kBarCells = 24;

std::string bar(double fraction) {
  const auto filled = static_cast<size_t>(std::clamp(fraction, 0.0, 1.0) * kBarCells);
  std::string cells(kBarCells, '.');
  cells.replace(0, filled, filled, '#');
  return '[' + cells + ']';
}

size_t terminal_columns() {
  winsize size = {};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

}  // namespace

std::string progress_sentence(const JobMessage& job) {
  std::ostringstream text;
  const bool running = job.state == "running";
  text << (running ? job.stage : job.state);
  if (running)
    text << ' ' << std::lround(std::clamp(job.progress.fraction, 0.0, 1.0) * 100) << " %";
  if (job.progress.total > 0 && !job.plan_only)
    text << ", " << job.progress.done << " of " << job.progress.total << ' ' << job.progress.unit
         << 's';
  if (job.quality.error)
    text << ", error " << format_error(*job.quality.error) << " of "
         << format_error(job.quality.target);
  if (!job.terminal && job.progress.eta_s)
    text << ", " << format_seconds(*job.progress.eta_s) << " left";
  if (job.state == "queued" && !job.reason.empty()) text << ": " << job.reason;
  return printable(text.str());
}

ProgressDisplay::ProgressDisplay(bool quiet)
    : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

void ProgressDisplay::show(const JobMessage& job) {
  if (quiet_) return;
  if (terminal_) {
    std::string line = bar(job.progress.fraction) + " " + progress_sentence(job);
    const size_t columns = terminal_columns();
    if (line.size() >= columns) line.resize(columns - 1);
    std::cerr << "\r\033[K" << line << std::flush;
    shown_ = true;
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  const std::string state = job.state + " " + job.stage;
  if (state == last_state_ && now - last_line_ < kPlainInterval) return;
  last_state_ = state;
  last_line_ = now;
  std::cerr << "job " << printable(job.id) << ": " << progress_sentence(job) << '\n';
}

void ProgressDisplay::clear() {
  if (shown_) std::cerr << "\r\033[K" << std::flush;
  shown_ = false;
}

}  // namespace lightkiln::cli

#include "server/cli/commands/private_daemon.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/error.h"

namespace lightkiln::cli {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto kStartLimit = std::chrono::seconds(30);
constexpr auto kStopLimit = std::chrono::seconds(10);
constexpr auto kPoll = std::chrono::milliseconds(5);

fs::path find_kilnd() {
  if (const char* named = std::getenv("LIGHTKILN_KILND")) return named;
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const fs::path beside = self.parent_path() / "kilnd";
  if (error || !fs::exists(beside))
    throw Error(ErrorCode::not_found,
                "There is no kilnd beside kiln to bake with; name a server with --server or the "
                "program with LIGHTKILN_KILND.");
  return beside;
}

std::string read_small(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// The end of the daemon's log, to say why it did not start.
std::string last_lines(const fs::path& log) {
  std::string text = read_small(log);
  while (text.ends_with('\n')) text.pop_back();
  return text.size() > 600 ? text.substr(text.size() - 600) : text;
}

[[noreturn]] void run_child(const std::vector<std::string>& words, const char* log) {
  // A group of its own: Ctrl-C is for kiln, which then decides.
  setpgid(0, 0);
  const int out = open(log, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const int in = open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (out >= 0 && in >= 0 && dup2(in, 0) == 0 && dup2(out, 1) == 1 && dup2(out, 2) == 2) {
    std::vector<char*> pointers;
    for (const std::string& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
    pointers.push_back(nullptr);
    execv(pointers[0], pointers.data());
    const std::string sentence = words[0] + ": " + std::strerror(errno) + "\n";
    const ssize_t written = write(2, sentence.data(), sentence.size());
    static_cast<void>(written);
  }
  _exit(127);
}

}  // namespace

fs::path default_store() {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  const char* home = std::getenv("HOME");
  if (cache && cache[0] == '/') return fs::path(cache) / "lightkiln" / "store";
  if (home && home[0] == '/') return fs::path(home) / ".cache" / "lightkiln" / "store";
  throw Error(ErrorCode::not_found,
              "Neither XDG_CACHE_HOME nor HOME says where the store may be; use --store.");
}

PrivateDaemon::PrivateDaemon(const PrivateDaemonOptions& options, const Attention& attention)
    : store_(fs::absolute(options.store)) {
  std::error_code error;
  fs::create_directories(store_, error);
  if (error)
    throw Error(ErrorCode::not_found,
                "The store " + store_.string() + " cannot be made: " + error.message() + ".");
  fs::permissions(store_, fs::perms::owner_all, error);
  try {
    lock(attention);
    start(options.threads);
    wait_for_port(attention);
  } catch (...) {
    stop();
    throw;
  }
}

PrivateDaemon::~PrivateDaemon() {
  stop();
}

void PrivateDaemon::lock(const Attention& attention) {
  const fs::path path = store_ / "kiln.lock";
  lock_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_ < 0)
    throw Error(ErrorCode::not_found,
                "The store " + store_.string() + " cannot be used: " + std::strerror(errno) + ".");
  for (bool told = false; flock(lock_, LOCK_EX | LOCK_NB) != 0; told = true) {
    if (!told) std::cerr << "Waiting for another kiln that uses " << store_.string() << ".\n";
    if (attention.wanted()) throw Error(ErrorCode::cancelled, "The wait was interrupted.");
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

void PrivateDaemon::start(int threads) {
  const fs::path port_file = store_ / "kiln.port";
  const std::string log = (store_ / "kilnd.log").string();
  fs::remove(port_file);
  const std::vector<std::string> words = {find_kilnd().string(),
                                          "serve",
                                          "--store",
                                          store_.string(),
                                          "--listen",
                                          "127.0.0.1:0",
                                          "--port-file",
                                          port_file.string(),
                                          "--workers",
                                          "1",
                                          "--threads",
                                          std::to_string(threads),
                                          "--allow-missing-sandbox",
                                          "all",  // kiln bake warns of it
                                          "--parent-watch"};
  child_ = fork();
  if (child_ < 0)
    throw Error(ErrorCode::internal,
                std::string("kilnd cannot be started: ") + std::strerror(errno) + ".");
  if (child_ == 0) run_child(words, log.c_str());
}

void PrivateDaemon::wait_for_port(const Attention& attention) {
  const auto end = Clock::now() + kStartLimit;
  while (true) {
    const std::string text = read_small(store_ / "kiln.port");
    if (text.find_first_of("0123456789") == 0) {
      url_ = "http://127.0.0.1:" + std::to_string(std::atoi(text.c_str()));
      return;
    }
    int status = 0;
    const bool ended = waitpid(child_, &status, WNOHANG) == child_;
    if (ended) child_ = -1;
    if (ended || Clock::now() > end)
      throw Error(ErrorCode::internal, std::string(ended ? "kilnd ended while starting: "
                                                         : "kilnd named no port within 30 s: ") +
                                           last_lines(store_ / "kilnd.log"));
    if (attention.wanted()) throw Error(ErrorCode::cancelled, "The start was interrupted.");
    std::this_thread::sleep_for(kPoll);
  }
}

void PrivateDaemon::stop() {
  if (child_ > 0) {
    kill(child_, SIGTERM);
    const auto end = Clock::now() + kStopLimit;
    int status = 0;
    while (waitpid(child_, &status, WNOHANG) == 0) {
      if (Clock::now() > end) {
        kill(child_, SIGKILL);
        waitpid(child_, &status, 0);
        break;
      }
      std::this_thread::sleep_for(kPoll);
    }
    child_ = -1;
  }
  if (lock_ >= 0) close(lock_);
  lock_ = -1;
}

}  // namespace lightkiln::cli

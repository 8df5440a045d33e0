#include "server/store/process_identity.h"

#include <fstream>
#include <sstream>

#include <sys/stat.h>
#include <unistd.h>

namespace lightkiln {

namespace {

struct ProcessFacts {
  bool exists = false;
  char state = '?';
  std::string start_ticks;
};

// /proc/<pid>/stat: the name in parentheses may hold anything, so fields are counted from the last
// ')'. State is field 3, the start time field 22 (proc(5)).
ProcessFacts process_facts(const std::string& pid) {
  std::ifstream in("/proc/" + pid + "/stat");
  std::string text;
  std::getline(in, text, '\0');  // a process that ends meanwhile leaves this empty
  const size_t close = text.rfind(')');
  if (close == std::string::npos) return {};
  std::istringstream fields(text.substr(close + 1));
  ProcessFacts facts;
  std::string field;
  for (int number = 3; number <= 22 && fields >> field; ++number) {
    if (number == 3) facts.state = field[0];
    if (number == 22) {
      facts.start_ticks = field;
      facts.exists = true;
    }
  }
  return facts;
}

std::string pid_namespace() {
  struct stat info {};
  if (stat("/proc/self/ns/pid", &info) != 0) return "unknown";
  return std::to_string(info.st_ino);
}

}  // namespace

std::string boot_identity() {
  std::ifstream in("/proc/sys/kernel/random/boot_id");
  std::string id;
  in >> id;
  return id.empty() ? "unknown" : id;
}

std::string own_process_identity() {
  const std::string pid = std::to_string(getpid());
  return boot_identity() + "/" + pid_namespace() + "/" + pid + "/" + process_facts(pid).start_ticks;
}

bool is_provably_dead(const std::string& identity) {
  std::istringstream in(identity);
  std::string boot, space, pid, start;
  if (!std::getline(in, boot, '/') || !std::getline(in, space, '/') ||
      !std::getline(in, pid, '/') || !std::getline(in, start))
    return false;
  if (boot == "unknown" || space == "unknown" || start.empty()) return false;
  if (boot != boot_identity() || space != pid_namespace()) return false;
  const ProcessFacts facts = process_facts(pid);
  return !facts.exists || facts.start_ticks != start || facts.state == 'Z' || facts.state == 'X';
}

}  // namespace lightkiln

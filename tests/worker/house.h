#pragma once

// A store with real workers and ovens, and the orders that tests of them share.

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <sys/types.h>

#include "server/store/store.h"
#include "server/worker/worker.h"
#include "tests/support/data.h"

namespace lightkiln::test {

std::vector<std::byte> box_on_a_floor(int divisions);
std::vector<std::byte> one_triangle();

inline constexpr const char* kCoarse = R"("accuracy":{"target_error":0.03})";
inline constexpr const char* kFine = R"("accuracy":{"target_error":0.0005,"max_samples":1048576})";

std::vector<pid_t> children_of(pid_t parent);
bool is_running(pid_t pid);  // a zombie does not

// Looks every millisecond until `condition` holds; false when it never does.
bool eventually(const std::function<bool()>& condition);

class House {
 public:
  House();
  ~House();
  House(const House&) = delete;
  House& operator=(const House&) = delete;

  Store& store() { return *store_; }
  std::string directory() const { return (folder_.path() / "store").string(); }

  // An ambient-occlusion order for a scene; `rest` are further members of the spec.
  std::string order(const std::vector<std::byte>& glb, const std::string& rest,
                    bool plan_only = false);
  JobRecord job(const std::string& id) { return store_->find_job(id).value(); }

  WorkerOptions worker_options() const;
  // With a worker in this process, until it is idle.
  JobRecord bake(const std::string& id, const WorkerOptions& options);
  // A process that works until it is ended.
  pid_t start_worker(WorkerOptions options);
  // A daemon with one worker, on a free port.
  pid_t start_daemon();
  // The exit code, or -signal.
  int end_process(pid_t pid, int signal);

  // What must not depend on how a job went: everything but the times in plan and accuracy.
  std::map<std::string, std::string> timeless_digests(const std::string& id);
  // Every chunk's commits, by index.
  std::map<std::string, int> chunk_commits(const std::string& id);
  void expect_every_chunk_once(const std::string& id);

 private:
  TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
  std::set<pid_t> processes_;
};

// The undisturbed truth of box_on_a_floor(60) with kCoarse that kills, threads and chunk sizes are
// held against.
const std::map<std::string, std::string>& undisturbed();

}  // namespace lightkiln::test

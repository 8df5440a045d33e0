#pragma once

// A fixed number of threads behind a bounded queue: when it is full the caller is told, and says
// 503.

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace lightkiln {

class Pool {
 public:
  Pool(int threads, size_t queue);
  ~Pool();  // finishes what is queued
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  // False when the queue is full; the task is then untouched. Tasks must not throw.
  bool try_push(std::function<void()>&& task);

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable ready_;
  std::deque<std::function<void()>> tasks_;
  const size_t limit_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace lightkiln

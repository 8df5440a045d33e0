#pragma once

// Takes away what nobody needs any more, from a thread of its own, a little after the start and
// then every hour or every tenth of the age, whichever is sooner.

#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/http/log.h"
#include "server/store/store.h"

namespace lightkiln {

class Housekeeper {
 public:
  // Blobs unused for `keep_unused_s` seconds go; 0 = none ever. `store` and `log` outlive the
  // object.
  Housekeeper(Store& store, Log& log, double keep_unused_s);
  ~Housekeeper();
  Housekeeper(const Housekeeper&) = delete;
  Housekeeper& operator=(const Housekeeper&) = delete;

 private:
  void run(double keep_unused_s);
  void collect(double keep_unused_s);

  Store& store_;
  Log& log_;
  std::mutex mutex_;
  std::condition_variable ended_;
  bool end_ = false;
  std::thread thread_;
};

}  // namespace lightkiln

#pragma once

// The thread that watches every socket. See fence.h for what it guards.

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "server/http/connection.h"
#include "server/http/fence.h"
#include "server/http/pool.h"
#include "server/http/wire.h"

namespace lightkiln {

class Loop {
 public:
  Loop(const FenceLimits& limits, const HttpApplication& application, Wire& wire);
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  void start();                 // the wire listens already
  void stop(int64_t drain_ms);  // see Fence::stop

 private:
  // Events.
  void run();
  void accept_all();
  void on_event(Connection& c);
  void take_finished();
  void take_pipelined();
  void sweep();
  void sweep_one(Connection& c, Clock::time_point now);

  // Steps of one connection. Each leaves it armed, in a pool thread's hands, or closed.
  void receive(Connection& c);
  void advance(Connection& c);
  void begin_request(Connection& c, size_t head_bytes);
  void begin_body(Connection& c, const Admission& admission);
  void dispatch(Connection& c);
  void work(Connection& c);  // on a pool thread
  void reply(Connection& c, const HttpReply& answer, bool close);
  void refuse(Connection& c, int status, const std::string& detail);
  void send(Connection& c);
  void finish_reply(Connection& c);
  void drain(Connection& c);
  void arm(Connection& c, bool for_write);
  void close(Connection& c);

  bool take_upload_place(Connection& c);
  void give_upload_place_back(Connection& c);
  bool make_room(const std::string& address);
  void render(Connection& c, const HttpReply& answer, bool close);

  const FenceLimits& limits_;
  const HttpApplication& application_;
  Wire& wire_;
  int epoll_ = -1;
  int wake_ = -1;
  bool accepting_ = false;
  bool listener_armed_ = false;
  std::unordered_map<int, std::unique_ptr<Connection>> connections_;  // by descriptor
  std::unordered_map<std::string, int> per_address_;
  std::vector<int> pipelined_;  // descriptors with a further request already received
  uint64_t reserved_ = 0;
  int uploads_ = 0;
  std::unordered_map<std::string, int> uploads_per_address_;

  std::mutex mutex_;  // guards the next three
  std::vector<Connection*> finished_;
  bool stopping_ = false;
  Clock::time_point deadline_ = Clock::time_point::max();

  Clock::time_point drain_until_ = Clock::time_point::max();  // the watching thread's copy
  Clock::time_point last_sweep_ = Clock::now();
  std::unique_ptr<Pool> pool_;
  std::thread thread_;
};

}  // namespace lightkiln

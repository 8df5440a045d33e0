#include "server/worker/worker.h"

#include <csignal>
#include <cstdio>
#include <limits>
#include <memory>

#include <unistd.h>

#include "core/base/parallel.h"
#include "server/store/job_id.h"
#include "server/worker/back_off.h"
#include "server/worker/feed.h"
#include "server/worker/heartbeat.h"
#include "server/worker/sandbox_policy.h"

namespace lightkiln {

namespace {

constexpr int64_t kIdleWaitMs = 500;
constexpr int kFirstGreetingMs = 10'000;
constexpr int kPauseSliceUs = 20'000;
// Times in a row that a worker gives one task back because the store refused. With the pauses
// between them that is some three quarters of a minute.
constexpr int kMaxRefusedTries = 12;
constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kCancelGraceMs = 1000;  // from a polite request to SIGKILL

// A handler runs on whichever thread the signal meets, so this is no sig_atomic_t.
std::atomic<bool> g_signalled{false};
static_assert(std::atomic<bool>::is_always_lock_free);

// SIGTERM and SIGINT ask for an orderly end; the handlers of before come back afterwards.
class StopSignals {
 public:
  StopSignals() {
    g_signalled.store(false);
    struct sigaction action {};
    action.sa_handler = [](int) { g_signalled.store(true); };
    sigaction(SIGTERM, &action, &term_);
    sigaction(SIGINT, &action, &int_);
  }
  ~StopSignals() {
    sigaction(SIGTERM, &term_, nullptr);
    sigaction(SIGINT, &int_, nullptr);
  }
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  struct sigaction term_ {
  }, int_{};
};

class Worker {
 public:
  explicit Worker(const WorkerOptions& options)
      : options_(options),
        store_(open_sqlite_store(store_options(options))),
        name_((options.name.empty() ? "worker" : options.name) + "-" + random_hex(8)) {}

  int run() {
    prepare_spare();
    greet(*spare_, kFirstGreetingMs);
    spare_greeted_ = true;
    while (!stopping()) {
      prepare_spare();
      if (!take_turn()) break;
      pause();
    }
    return 0;
  }

 private:
  static StoreOptions store_options(const WorkerOptions& options) {
    StoreOptions store;
    store.directory = options.store_directory;
    store.lease_ms = options.lease_ms;
    return store;
  }

  bool stopping() const { return g_signalled.load() || (options_.stop && options_.stop->load()); }
  bool timed_out() const { return wall_seconds() > deadline_s_; }
  bool interrupted() const {
    return stopping() || timed_out() || (heartbeat_ && heartbeat_->lost());
  }

  // Does a task, or waits for one; false when there is none and the worker is to end then. A busy
  // or full store says nothing about that: it is left alone for a while and asked again.
  bool take_turn() {
    std::optional<Claim> claim;
    try {
      claim = store_->claim(name_, oven_job_);
      if (!claim) {
        end_oven();
        if (!options_.exit_when_idle) store_->wait_for_work(kIdleWaitMs);
      }
    } catch (const Error& error) {
      if (error.code() != ErrorCode::unavailable) throw;
      note_refusal(error);
      return true;
    }
    if (!claim) {
      note_health();
      return !options_.exit_when_idle;
    }
    work(*claim);
    return true;
  }

  // Each change of its state is worth one line, and no more.
  void note_refusal(const Error& error) {
    if (back_off_.refused(error.what()))
      std::fprintf(stderr, "worker: backing off: %s\n", error.what());
  }
  void note_health() {
    refused_tries_ = 0;
    if (back_off_.obliged()) std::fprintf(stderr, "worker: works again\n");
  }
  void pause() const {
    const double until_s = wall_seconds() + back_off_.pause_s();
    while (!stopping() && wall_seconds() < until_s) usleep(kPauseSliceUs);
  }

  std::unique_ptr<OvenProcess> start_oven() {
    return std::make_unique<OvenProcess>(
        OvenOptions{options_.oven_path, options_.oven_memory_bytes},
        [this] { return interrupted(); });
  }
  void prepare_spare() {
    if (spare_ && !spare_->ended()) return;
    spare_greeted_ = false;
    spare_ = start_oven();
  }
  void end_oven() {
    oven_.reset();
    oven_job_.clear();
  }

  // What the first oven lacks is told to the store and the log; no oven is used that lacks more
  // than is allowed.
  void greet(OvenProcess& oven, int wait_ms) {
    const std::vector<std::string> missing = read_greeting(oven, wait_ms);
    require_sandbox(missing, options_.allow_missing_sandbox);
    if (std::exchange(enlisted_, true)) return;
    store_->enlist(name_, missing);
    for (const std::string& layer : missing)
      std::fprintf(stderr, "worker: the oven's sandbox lacks a layer: %s\n", layer.c_str());
  }

  // The oven that holds the claim's job, loading it into the spare one when there is none.
  OvenProcess& oven_for(const Claim& claim) {
    if (oven_ && oven_job_ == claim.job_id) return *oven_;
    end_oven();
    prepare_spare();
    oven_ = std::move(spare_);
    oven_job_ = claim.job_id;
    if (!std::exchange(spare_greeted_, false)) greet(*oven_, -1);
    const FeedOptions feed{options_.threads, options_.oven_memory_bytes, options_.chunk_seconds};
    feed_job(*oven_, *store_, claim, feed, on_progress());
    if (claim.type != TaskType::plan) feed_known_plan(*oven_, claim.plan_json);
    return *oven_;
  }

  OnProgress on_progress() {
    return [this](double fraction) { heartbeat_->set_fraction(fraction); };
  }

  void bake(const Claim& claim) {
    OvenProcess& oven = oven_for(claim);
    switch (claim.type) {
      case TaskType::plan: {
        const PlanAnswer plan = feed_plan(oven, on_progress());
        store_->commit_plan(claim, plan.plan_json, plan.chunks, plan.predicted_s);
        return;
      }
      case TaskType::chunk:
        store_->commit_chunk(claim, feed_chunk(oven, claim.chunk_index, on_progress()));
        return;
      case TaskType::assemble: {
        if (!give_chunks(oven, claim)) return;
        const auto result = store_->begin_result(claim);
        const auto take = [&](NewArtifact artifact) { result->add(std::move(artifact)); };
        result->commit(feed_assembly(oven, take, on_progress()));
        end_oven();
        return;
      }
    }
  }

  // False when some of them were damaged and wait to be baked again; the oven has a part of them
  // then and is of no more use.
  bool give_chunks(OvenProcess& oven, const Claim& claim) {
    try {
      store_->load_chunks(claim.job_id,
                          [&](const StoredChunk& chunk) { feed_stored_chunk(oven, chunk); });
      return true;
    } catch (const Error& error) {
      const bool damaged =
          error.code() == ErrorCode::internal || error.code() == ErrorCode::not_found;
      if (!damaged || !store_->rebake_lost_chunks(claim)) throw;
      std::fprintf(stderr, "worker: %s\n", error.what());
      end_oven();
      return false;
    }
  }

  void work(const Claim& claim) {
    try {
      try_to_bake(claim);
    } catch (const Error& error) {
      // The store did not take the outcome; the lease runs out and the task is done again.
      note_refusal(error);
      end_oven();
    }
    heartbeat_.reset();
    deadline_s_ = kNever;
  }

  void try_to_bake(const Claim& claim) {
    deadline_s_ = wall_seconds() + options_.task_seconds;
    heartbeat_ = std::make_unique<Heartbeat>(*store_, claim, options_.lease_ms);
    try {
      bake(claim);
      note_health();
    } catch (const OvenFailure& failure) {
      end_oven();
      store_->fail_task(claim, failure.error, failure.crashed);
    } catch (const PeerGone&) {
      const OvenDeath death = oven_->bury();
      end_oven();
      store_->fail_task(claim, {death.code, death.sentence, ""}, true);
    } catch (const Error& error) {
      if (error.code() == ErrorCode::cancelled)
        give_up(claim);
      else
        fail_here(claim, error);
    }
  }

  // The work was interrupted: the job is cancelled, the lease lost, the worker asked to end, or the
  // task's time is over.
  void give_up(const Claim& claim) {
    const bool lost = heartbeat_->lost();
    const bool late = !lost && !stopping();
    if (oven_) oven_->stop(stopping() ? 0 : kCancelGraceMs);
    end_oven();
    if (late)
      store_->fail_task(claim,
                        {error_code_name(ErrorCode::timed_out),
                         "A task of this job took longer than the " +
                             std::to_string(static_cast<int>(options_.task_seconds)) +
                             " s that this worker allows.",
                         ""},
                        true);
    else if (!lost)
      store_->release(claim, "Waiting for a worker: the last one shut down.");
  }

  // The store failed, or this program did. A store that is busy or full is not the task's fault,
  // and yet the same work is not done over and over for it.
  void fail_here(const Claim& claim, const Error& error) {
    end_oven();
    if (error.code() == ErrorCode::unavailable) {
      note_refusal(error);
      if (++refused_tries_ < kMaxRefusedTries)
        return store_->release(claim, std::string("Waiting to try again: ") + error.what());
      refused_tries_ = 0;
      return store_->fail_task(claim, {error_code_name(error.code()), error.what(), ""}, false);
    }
    std::fprintf(stderr, "worker: %s\n", error.what());
    store_->fail_task(
        claim,
        {error_code_name(ErrorCode::internal),
         "The bake failed by a mistake of Lightkiln's own; the worker's log has more.", ""},
        false);
  }

  const WorkerOptions options_;
  std::unique_ptr<Store> store_;
  const std::string name_;
  std::unique_ptr<OvenProcess> oven_;  // holds oven_job_
  std::string oven_job_;
  std::unique_ptr<OvenProcess> spare_;  // started, sandboxed, waiting
  bool spare_greeted_ = false;          // its hello was read
  bool enlisted_ = false;
  std::unique_ptr<Heartbeat> heartbeat_;
  double deadline_s_ = kNever;
  BackOff back_off_;
  int refused_tries_ = 0;  // tasks in a row given back because of a refusal
};

}  // namespace

int run_worker(const WorkerOptions& options) {
  const StopSignals signals;
  return Worker(options).run();
}

}  // namespace lightkiln

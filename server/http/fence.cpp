#include "server/http/fence.h"

#include <utility>

#include "server/http/loop.h"
#include "server/http/wire.h"

namespace lightkiln {

struct Fence::Impl {
  Impl(const FenceLimits& given, HttpApplication app)
      : limits(given),
        application(std::move(app)),
        wire(static_cast<int>(limits.idle_ms / 1000), limits.requests_per_connection),
        loop(limits, application, wire) {}

  const FenceLimits limits;
  const HttpApplication application;
  Wire wire;
  Loop loop;
};

Fence::Fence(const FenceLimits& limits, HttpApplication application)
    : impl_(std::make_unique<Impl>(limits, std::move(application))) {}

Fence::~Fence() = default;

int Fence::listen(const std::string& host, int port) {
  const int bound = impl_->wire.listen(host, port, impl_->limits.backlog);
  impl_->loop.start();
  return bound;
}

void Fence::stop(int64_t drain_ms) {
  impl_->loop.stop(drain_ms);
}

}  // namespace lightkiln

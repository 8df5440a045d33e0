#pragma once

// How long to leave a thing alone that has just refused, and when to speak of it.

#include <algorithm>
#include <string>

namespace lightkiln {

class BackOff {
 public:
  static constexpr double kFirst_s = 0.1;
  static constexpr double kLongest_s = 5.0;

  // Notes one more refusal in a row. True when it is news: the first, or one of another wording.
  bool refused(const std::string& why) {
    pause_s_ = pause_s_ > 0 ? std::min(2 * pause_s_, kLongest_s) : kFirst_s;
    if (why == why_) return false;
    why_ = why;
    return true;
  }
  // Notes that it obliged. True when that is news.
  bool obliged() {
    const bool news = pause_s_ > 0;
    pause_s_ = 0;
    why_.clear();
    return news;
  }
  double pause_s() const { return pause_s_; }  // 0 while nothing was refused

 private:
  double pause_s_ = 0;
  std::string why_;
};

}  // namespace lightkiln

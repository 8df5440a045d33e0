#pragma once

// Which route a request takes, by its path's segments; no regular expressions.
//
// A pattern is a path of literal segments and parameters: "/v1/jobs/{id}/plan". A parameter may be
// followed by a verb: "/v1/jobs/{id}:cancel". Parameters hold no ':' except {digest}, and are never
// empty.

#include <string>
#include <string_view>
#include <vector>

namespace lightkiln {

class Router {
 public:
  // Adds a route and gives it the next number, from 0.
  void add(std::string method, std::string_view pattern);

  struct Match {
    int route = -1;                   // -1: none
    std::vector<std::string> values;  // of the pattern's parameters, in order
    std::vector<std::string>
        allowed;  // methods of the path, when it is known and the method is not
  };
  // HEAD takes GET's route where it has none of its own.
  Match match(std::string_view method, const std::vector<std::string>& segments) const;

 private:
  struct Segment {
    bool parameter = false;
    bool any_colon = false;
    std::string text;  // the literal, or what follows the parameter
  };
  struct Entry {
    std::string method;
    std::vector<Segment> segments;
  };
  static bool matches(const Entry& entry, const std::vector<std::string>& segments,
                      std::vector<std::string>& values);
  std::vector<Entry> entries_;
};

}  // namespace lightkiln

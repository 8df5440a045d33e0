// Nodes must form a forest: each has one parent at most, none is its own ancestor, and no branch is
// deeper than what every later walk may assume. Nothing here recurses.

#include <numeric>

#include "core/base/error.h"
#include "core/scene/gltf_file.h"

namespace lightkiln {

namespace {

std::string node_path(size_t node) {
  return "/nodes/" + std::to_string(node);
}

// The children of every node, as checked indices.
std::vector<std::vector<size_t>> children_of(const GltfFile& file) {
  std::vector<std::vector<size_t>> children(section_size(file.json, "nodes"));
  for (size_t node = 0; node < children.size(); ++node) {
    const JsonValue& value = (*file.json.find("nodes")->array())[node];
    const JsonValue* list = value.find("children");
    if (!list) continue;
    for (const JsonValue& child : *list->array()) {
      children[node].push_back(static_cast<size_t>(std::get<double>(child.data)));
    }
  }
  return children;
}

// Depth-first with an explicit stack; meeting a node that is still open closes a loop.
void refuse_loops(const std::vector<std::vector<size_t>>& children) {
  enum class State : uint8_t { unseen, open, done };
  std::vector<State> state(children.size(), State::unseen);
  struct Visit {
    size_t node, next;
  };
  std::vector<Visit> stack;
  for (size_t start = 0; start < children.size(); ++start) {
    if (state[start] != State::unseen) continue;
    stack.push_back({start, 0});
    state[start] = State::open;
    while (!stack.empty()) {
      Visit& visit = stack.back();
      if (visit.next == children[visit.node].size()) {
        state[visit.node] = State::done;
        stack.pop_back();
        continue;
      }
      const size_t child = children[visit.node][visit.next++];
      if (state[child] == State::open) {
        throw Error(ErrorCode::invalid_input,
                    "Node " + std::to_string(child) +
                        " is its own ancestor (NODE_LOOP); nodes must form trees.",
                    node_path(visit.node) + "/children/" + std::to_string(visit.next - 1));
      }
      if (state[child] == State::unseen) {
        state[child] = State::open;
        stack.push_back({child, 0});
      }
    }
  }
}

// Returns which nodes have a parent.
std::vector<bool> refuse_second_parents(const std::vector<std::vector<size_t>>& children) {
  std::vector<bool> has_parent(children.size(), false);
  for (size_t node = 0; node < children.size(); ++node) {
    for (size_t i = 0; i < children[node].size(); ++i) {
      const size_t child = children[node][i];
      if (has_parent[child]) {
        throw Error(ErrorCode::invalid_input,
                    "Node " + std::to_string(child) +
                        " has a second parent (NODE_PARENT_OVERRIDE); glTF allows one. Instances "
                        "are made by nodes that share a mesh.",
                    node_path(node) + "/children/" + std::to_string(i));
      }
      has_parent[child] = true;
    }
  }
  return has_parent;
}

void refuse_depth(const std::vector<std::vector<size_t>>& children,
                  const std::vector<bool>& has_parent) {
  std::vector<std::pair<size_t, size_t>> stack;
  for (size_t node = 0; node < children.size(); ++node) {
    if (!has_parent[node]) stack.emplace_back(node, 1);
  }
  while (!stack.empty()) {
    const auto [node, depth] = stack.back();
    stack.pop_back();
    if (depth > kMaxNodeDepth) {
      throw Error(ErrorCode::too_large,
                  "The node hierarchy is deeper than " + std::to_string(kMaxNodeDepth) + " levels.",
                  node_path(node));
    }
    for (const size_t child : children[node]) stack.emplace_back(child, depth + 1);
  }
}

void check_scene_roots(const JsonAt& scenes, const std::vector<bool>& has_parent) {
  for (size_t i = 0; i < scenes.size(); ++i) {
    const auto roots = scenes[i].find("nodes");
    if (!roots) continue;
    std::vector<bool> seen(has_parent.size(), false);
    for (size_t k = 0; k < roots->size(); ++k) {
      const JsonAt root = (*roots)[k];
      const size_t node = root.integer(0, has_parent.size() - 1);
      if (has_parent[node]) {
        root.fail("A scene must list root nodes only, but node " + std::to_string(node) +
                  " has a parent (SCENE_NON_ROOT_NODE).");
      }
      if (seen[node]) root.fail("The scene lists node " + std::to_string(node) + " twice.");
      seen[node] = true;
    }
  }
}

}  // namespace

void check_node_forest(const GltfFile& file) {
  const auto children = children_of(file);
  refuse_loops(children);
  const std::vector<bool> has_parent = refuse_second_parents(children);
  refuse_depth(children, has_parent);
  if (const auto scenes = JsonAt(file.json, "").find("scenes")) {
    check_scene_roots(*scenes, has_parent);
  }
}

}  // namespace lightkiln

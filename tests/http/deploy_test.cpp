// What deploy/ starts is what kilnd understands.

#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "proto/json_value.h"
#include "server/daemon/config.h"
#include "tests/support/data.h"

namespace lightkiln::test {
namespace {

// The lines of a file under deploy/ that begin with `key`, without it.
std::vector<std::string> lines_of(const std::string& file, const std::string& key) {
  std::ifstream in(std::string(LIGHTKILN_SOURCE_DIR) + "/deploy/" + file);
  std::vector<std::string> found;
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(key)) found.push_back(line.substr(key.size()));
  return found;
}

ServeConfig parse(const std::vector<std::string>& words) {
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  const Command command = parse_command_line(static_cast<int>(argv.size()), argv.data());
  if (const auto* end = std::get_if<CommandLineEnd>(&command)) {
    ADD_FAILURE() << end->text;
    return {};
  }
  return std::get<ServeConfig>(command);
}

std::vector<std::string> json_words(const std::string& text) {
  const JsonValue list = read_trusted_json(text, ErrorCode::internal, "the instruction");
  std::vector<std::string> words;
  for (const JsonValue& word : *list.array()) words.push_back(*word.string());
  return words;
}

TEST(Deploy, TheUnitStartsADaemonOnLoopback) {
  const std::vector<std::string> commands = lines_of("systemd/kilnd.service", "ExecStart=");
  ASSERT_EQ(commands.size(), 1u);
  std::istringstream in(commands[0]);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  EXPECT_EQ(words.at(0), "/usr/bin/kilnd");
  const ServeConfig config = parse(words);
  EXPECT_EQ(config.host, "127.0.0.1");
  EXPECT_EQ(config.store_directory, "/var/lib/lightkiln");
  EXPECT_TRUE(config.allow_missing_sandbox.empty());
  EXPECT_EQ(lines_of("systemd/kilnd.service", "StateDirectory="),
            std::vector<std::string>{"lightkiln"});
}

TEST(Deploy, TheContainerStartsADaemonWithTokens) {
  std::vector<std::string> words = json_words(lines_of("Containerfile", "ENTRYPOINT ").at(0));
  const std::vector<std::string> more = json_words(lines_of("Containerfile", "CMD ").at(0));
  words.insert(words.end(), more.begin(), more.end());
  const ServeConfig config = parse(words);
  EXPECT_EQ(config.host, "0.0.0.0");
  EXPECT_FALSE(config.token_file.empty());
  EXPECT_EQ(config.allow_missing_sandbox, std::vector<std::string>{"namespaces"});
  EXPECT_EQ(lines_of("Containerfile", "VOLUME "), std::vector<std::string>{config.store_directory});
  EXPECT_EQ(lines_of("Containerfile", "USER ").size(), 1u) << "not root";
}

}  // namespace
}  // namespace lightkiln::test

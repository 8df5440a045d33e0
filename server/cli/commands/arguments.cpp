#include "server/cli/commands/arguments.h"

#include <cmath>
#include <iostream>

#include <CLI/CLI.hpp>

#include "server/cli/commands/exit_code.h"

namespace lightkiln::cli {
namespace {

constexpr const char* kFooter =
    "\nExamples:\n"
    "  kiln bake order.json -o results          bake on this machine, nothing else running\n"
    "  kiln bake order.json -o results --server http://farm:7420\n"
    "  kiln plan order.json                     effects with reasons, and what each error costs\n"
    "  kiln view results/sky.exr -o sky.png\n"
    "\nExit codes: 0 succeeded, 1 failed, 2 usage, 3 order refused, 4 token, 5 cancelled,\n"
    "6 --max-error missed, 7 server unreachable, 8 not found, 9 digest mismatch, 124 --timeout,\n"
    "130 interrupted.\n";

// Accepts "key=value" and "key:value".
void add_label(const std::string& text, std::map<std::string, std::string>* labels) {
  const size_t split = text.find_first_of("=:");
  if (split == 0 || split == std::string::npos)
    throw CLI::ValidationError("--label", "\"" + text + "\" must read key=value");
  (*labels)[text.substr(0, split)] = text.substr(split + 1);
}

struct Parser {
  Arguments arguments;
  std::vector<std::string> labels;
  CLI::App app{"kiln orders bakes of light and fetches what comes of them.", "kiln"};

  Parser() {
    app.footer(kFooter);
    app.require_subcommand(1);
    add_bake();
    add_job_commands();
    add_ls();
    add_view();
    common(command(Verb::version, "version", "Show the client's version, and the server's."));
  }

  CLI::App* command(Verb verb, const char* name, const char* meaning) {
    CLI::App* sub = app.add_subcommand(name, meaning);
    sub->callback([this, verb] { arguments.verb = verb; });
    return sub;
  }

  void common(CLI::App* sub) {
    sub->add_option("--server", arguments.server, "The daemon, http://host:port")
        ->envname("LIGHTKILN_SERVER");
    sub->add_option("--token-file", arguments.token_file, "A file that holds the token")
        ->envname("LIGHTKILN_TOKEN_FILE");
    sub->add_flag("--json", arguments.json, "Print data as JSON");
    sub->add_flag("-q,--quiet", arguments.quiet, "No progress on stderr");
    sub->add_option("--timeout", arguments.timeout_s, "Seconds until kiln gives up with exit 124")
        ->check(CLI::Range(0.0, 1e9));
  }

  void order(CLI::App* sub) {
    common(sub);
    sub->add_option("order", arguments.target, "A spec as JSON; paths are relative to it")
        ->required();
    sub->add_option("--name", arguments.name, "A name for the job");
    sub->add_option("--label", labels, "key=value, to filter by; may be given again")
        ->allow_extra_args(false);
    sub->add_option("--priority", arguments.priority, "Larger is sooner")
        ->check(CLI::Range(-100, 100));
  }

  void private_daemon(CLI::App* sub) {
    sub->add_option("--store", arguments.store,
                    "Where the private daemon keeps its work, without --server");
    sub->add_option("--threads", arguments.threads,
                    "Threads of the private daemon; 0 = one per processor")
        ->check(CLI::Range(0, 1024));
  }

  void result_gate(CLI::App* sub) {
    sub->add_option_function<double>(
           "--max-error", [this](const double& value) { arguments.max_error = value; },
           "Exit 6 when the result's error is above this")
        ->check(CLI::Range(0.0, 1e9));
    sub->add_flag("--cancel-on-timeout", arguments.cancel_on_timeout,
                  "Cancel the job when --timeout passes");
  }

  void add_bake() {
    CLI::App* bake =
        command(Verb::bake, "bake", "Upload, submit, wait, fetch and verify an order.");
    order(bake);
    private_daemon(bake);
    result_gate(bake);
    bake->add_option("-o,--output", arguments.output, "Folder for the artifacts")->required();
    order(command(Verb::submit, "submit", "Upload and submit an order; prints the job's id."));
    CLI::App* plan = command(Verb::plan, "plan", "Show what an order would do and cost.");
    order(plan);
    private_daemon(plan);
  }

  CLI::App* job_command(Verb verb, const char* name, const char* meaning) {
    CLI::App* sub = command(verb, name, meaning);
    common(sub);
    sub->add_option("job", arguments.target, "The job's id")->required();
    return sub;
  }

  void add_job_commands() {
    result_gate(job_command(Verb::wait, "wait", "Wait until a job ends; the exit tells how."));
    CLI::App* fetch = job_command(Verb::fetch, "fetch", "Fetch and verify a job's artifacts.");
    fetch->add_option("artifacts", arguments.artifacts, "Only these");
    fetch->add_option("-o,--output", arguments.output, "Folder for the artifacts")->required();
    job_command(Verb::show, "show", "Show a job.");
    job_command(Verb::cancel, "cancel", "Cancel a job.");
  }

  void add_ls() {
    CLI::App* ls = command(Verb::ls, "ls", "List jobs, newest first.");
    common(ls);
    ls->add_option("--state", arguments.state, "Only this state")
        ->check(CLI::IsMember({"queued", "running", "succeeded", "failed", "cancelled"}));
    ls->add_option("--kind", arguments.kind, "Only this kind")
        ->check(CLI::IsMember({"ambient_occlusion", "environment_maps", "probes"}));
    ls->add_option("--text", arguments.text, "Only where the id or name contains this");
    ls->add_option("--label", labels, "Only with this label, key=value")->allow_extra_args(false);
    ls->add_option("--limit", arguments.limit, "Jobs at the most")->check(CLI::Range(1, 500));
  }

  void add_view() {
    CLI::App* view = command(Verb::view, "view", "Turn an EXR or HDR image into a PNG.");
    view->add_option("image", arguments.target, "The image")->required();
    view->add_option("-o,--output", arguments.output, "The PNG")->required();
    view->add_option("--exposure", arguments.exposure_stops, "Stops of exposure")
        ->check(CLI::Range(-64.0, 64.0));
  }

  void finish() {
    if (!std::isfinite(arguments.timeout_s) || !std::isfinite(arguments.exposure_stops) ||
        !std::isfinite(arguments.max_error.value_or(0)))
      throw CLI::ValidationError("numbers", "must be finite");
    for (const std::string& label : labels) add_label(label, &arguments.labels);
    if (arguments.verb != Verb::ls || arguments.labels.empty()) return;
    if (arguments.labels.size() > 1)
      throw CLI::ValidationError("--label", "ls filters by one label");
    const auto& [key, value] = *arguments.labels.begin();
    arguments.label = key + ":" + value;
  }
};

}  // namespace

ParsedArguments parse_arguments(int argc, const char* const* argv) {
  Parser parser;
  try {
    parser.app.parse(argc, argv);
    parser.finish();
  } catch (const CLI::ParseError& error) {
    const int code = parser.app.exit(error, std::cout, std::cerr);
    return {std::nullopt, code == 0 ? kSucceeded : kUsage};
  }
  return {parser.arguments, kSucceeded};
}

}  // namespace lightkiln::cli

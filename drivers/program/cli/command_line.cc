#include "drivers/program/cli/command_line.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>

#include "drivers/program/cli/say.h"
#include "pipeline/text/nearest.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

bool is_json = false;  // the command line has --json

}  // namespace

void print_json(const nlohmann::ordered_json& root) {
  std::puts(root.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

int report(const Error& error) {
  const std::string line = "epiline: error: " + error.text() + "\n";
  std::fputs(line.c_str(), stderr);  // it never throws
  if (is_json) {
    nlohmann::ordered_json root;
    root["schema"] = 1;
    nlohmann::ordered_json& e = root["error"];
    e["kind"] = error.kind == ErrorKind::kUsage ? "usage" : "run";
    e["file"] = error.file;
    e["line"] = error.line > 0 ? nlohmann::ordered_json(error.line) : nullptr;
    e["found"] = error.found;
    e["expected"] = error.expected;
    print_json(root);
  }
  return error.kind == ErrorKind::kUsage ? kExitUsage : kExitRunFailed;
}

int report_ended(std::size_t done, std::size_t all, const std::string& unit, const std::string& out) {
  return report({ErrorKind::kRun, "", 0,
                 fmt::format("ended by {} after {} of {} {}{}", EndRequest::signal_name(), done, all, unit,
                             done > 0 ? ", which are in " + out : ""),
                 ""});
}

Result<std::unique_ptr<LiveView>> open_view(const std::string& text) {
  if (text.empty()) return std::unique_ptr<LiveView>();
  const auto address = parse_view_address(text);
  if (!address) return address.error();
  auto view = LiveView::open(*address);
  if (!view) return view.error();
  for (const std::string& url : urls_of((*view)->address())) say("view      {}\n", url);
  return view;
}

void add_force(CLI::App& command, Foreign& foreign) {
  command.add_flag_callback(
      "--force", [&foreign] { foreign = Foreign::kReplace; },
      "replace files of --out that are no earlier results, too");
}

Result<std::optional<OutputFolder>> claim(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                          Foreign foreign) {
  if (folder.empty()) return std::optional<OutputFolder>();
  auto claimed = OutputFolder::claim(folder, names, foreign);
  if (!claimed) return claimed.error();
  return std::optional<OutputFolder>(std::move(*claimed));
}

void add_settings(CLI::App& command, std::filesystem::path& file, std::vector<std::string>& set,
                  const std::string& what) {
  command.add_option("--config", file, what);
  command.add_option("--set", set, "override one setting, as in --set tracker.max_features=100; may be repeated")
      ->type_name("SECTION.KEY=VALUE")
      ->allow_extra_args(false);
}

Result<std::filesystem::path> find_config(const std::filesystem::path& given) {
  if (!given.empty()) return given;
  for (const char* const path : {"/etc/epiline/epiline.toml", "epiline.toml"}) {
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored)) return std::filesystem::path(path);
  }
  return Error{ErrorKind::kUsage, "", 0, "no configuration",
               "--config FILE, or a file /etc/epiline/epiline.toml or ./epiline.toml (`epiline init` writes one)"};
}

namespace {

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

int run(int argc, char** argv, const char* name, const char* description,
        const std::function<void(CLI::App&, int&)>& add) {
  int exit_code = kExitDone;
  CLI::App app(description, name);
  app.require_subcommand(1);
  app.set_version_flag("--version", EPILINE_VERSION);
  add(app, exit_code);
  is_json = std::find(argv + 1, argv + std::max(argc, 1), std::string_view("--json")) != argv + std::max(argc, 1);
  const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
  const auto is_named = [&](const CLI::App* command) { return argc > 1 && command->check_name(argv[1]); };
  const bool is_known = std::any_of(commands.begin(), commands.end(), is_named);
  if (argc > 1 && argv[1][0] != '-' && !is_known) {
    std::vector<std::string> names;
    for (const CLI::App* command : commands) names.push_back(command->get_name());
    const std::string meant = nearest(argv[1], names);
    return report(
        {ErrorKind::kUsage, "", 0, "unknown command \"" + std::string(argv[1]) + "\"",
         (meant.empty() ? "" : "\"" + meant + "\", or ") + "a command that `" + std::string(name) + " --help` lists"});
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(e);  // --help, --version
    return report({ErrorKind::kUsage, "", 0, first_line(e.what()),
                   "options as `" + std::string(name) + " " + (is_known ? std::string(argv[1]) + " " : "") +
                       "--help` lists them"});
  }
  return exit_code;
}

/// Files that are opened must not get the numbers of closed streams: what is printed would go into them.
void open_closed_streams() {
  for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream)
    if (fcntl(stream, F_GETFD) < 0) (void)open("/dev/null", stream == STDIN_FILENO ? O_RDONLY : O_WRONLY);
}

/// What was printed counts as a result: it must have arrived.
int flushed(int exit_code) {
  const bool good = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (good || exit_code != kExitDone) return exit_code;
  return report({ErrorKind::kRun, "", 0, "the output cannot be written", "room where stdout goes"});
}

}  // namespace

int run_program(int argc, char** argv, const char* name, const char* description,
                const std::function<void(CLI::App&, int&)>& add) {
  open_closed_streams();
  handle_end_signals();
  try {
    return flushed(run(argc, argv, name, description, add));
  } catch (const std::exception& e) {
    return report({ErrorKind::kRun, "", 0, e.what(), ""});
  }
}

}  // namespace epiline

#include "tests/flights/studies.h"

namespace epiline {
namespace {

std::vector<const StudyEntry*>& studies() {
  static std::vector<const StudyEntry*> all;
  return all;
}

}  // namespace

StudyEntry::StudyEntry(const char* name_, const char* what_, AddStudy* add_) : name(name_), what(what_), add(add_) {
  studies().push_back(this);
}

}  // namespace epiline

int main(int argc, char** argv) {
  CLI::App app("Studies over many flights", "flights");
  app.require_subcommand(1);
  int exit_code = 0;
  for (const epiline::StudyEntry* study : epiline::studies()) {
    CLI::App& command = *app.add_subcommand(study->name, study->what);
    command.callback([&exit_code, run = study->add(command)] { exit_code = run(); });
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return exit_code;
}

#pragma once
// Studies over many flights, which no test needs. Each is a subcommand of the program `flights`.
#include <CLI/CLI.hpp>
#include <functional>
#include <vector>

namespace epiline {

/// Gives a command the options of a study; what it returns is called once they are read, and returns an exit code.
using AddStudy = std::function<int()>(CLI::App& command);

/// Each study's source has one.
struct StudyEntry {
  StudyEntry(const char* name_, const char* what_, AddStudy* add_);
  const char *name, *what;
  AddStudy* add;
};

}  // namespace epiline

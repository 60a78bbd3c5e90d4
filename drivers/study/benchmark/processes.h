#pragma once
// Programs run side by side, each a process of its own.
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

/// This program with other arguments. When it begins, its folder contains only the log of its output.
struct ProcessJob {
  std::vector<std::string> arguments;
  std::filesystem::path folder;
  std::filesystem::path log() const { return folder / "log.txt"; }
};

struct ProcessEnd {
  int exit_code = 0;  ///< meaningless if a signal ended it
  int signal = 0;     ///< that ended it; 0: none
};

/// Runs all jobs in their order, at most `side_by_side` of them at a time; calls `progress` with the number of ended
/// jobs and of all jobs. On a signal that ends programs it first ends the children. Fails if and only if interrupted in
/// this way (ErrorKind::kRun), or if a folder cannot be made or a process cannot be started. Call it from one thread
/// only, because it waits for every child.
Result<std::vector<ProcessEnd>> run_processes(const std::vector<ProcessJob>& jobs, int side_by_side,
                                              const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline

#pragma once
// Programs run side by side, each a process of its own.
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

/// This very program with other arguments. Its folder is empty when it begins, but for the log of what it prints.
struct ProcessJob {
  std::vector<std::string> arguments;
  std::filesystem::path folder;
  std::filesystem::path log() const { return folder / "log.txt"; }
};

struct ProcessEnd {
  int exit_code = 0;  ///< meaningless if a signal ended it
  int signal = 0;     ///< that ended it; 0: none
};

/// Runs all jobs, at most `side_by_side` of them at a time, in their order; `progress` is called with jobs ended and
/// jobs in all. On SIGINT or SIGTERM the children are ended first. Fails if and only if interrupted in this way
/// (ErrorKind::kRun) or if a folder cannot be made or a process not be started. Not to be called from two threads: it
/// waits for every child.
Result<std::vector<ProcessEnd>> run_processes(const std::vector<ProcessJob>& jobs, int side_by_side,
                                              const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline

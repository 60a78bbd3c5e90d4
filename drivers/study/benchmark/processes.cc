#include "drivers/study/benchmark/processes.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <map>

#include "pipeline/text/table.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

/// Blocks the signals that this program waits for; they stay pending until it asks for them, so that none is missed.
class HeldSignals {
 public:
  HeldSignals() {
    sigemptyset(&held_);
    for (const int s : {SIGCHLD, SIGINT, SIGTERM}) sigaddset(&held_, s);
    if (hangup_ends()) sigaddset(&held_, SIGHUP);
    pthread_sigmask(SIG_BLOCK, &held_, &before_);
  }
  ~HeldSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  HeldSignals(const HeldSignals&) = delete;
  HeldSignals& operator=(const HeldSignals&) = delete;

  /// The next of them; waits for it.
  int next() const {
    int s = 0;
    while (sigwait(&held_, &s) != 0) continue;
    return s;
  }
  const sigset_t& before() const { return before_; }

 private:
  sigset_t held_{}, before_{};
};

/// The running children. The destructor ends those that are left.
class Children {
 public:
  explicit Children(const HeldSignals& signals) : signals_(signals) {}
  ~Children() {
    for (const auto& [pid, job] : jobs_) kill(pid, SIGTERM);
    for (const auto& [pid, job] : jobs_) waitpid(pid, nullptr, 0);
  }
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;

  std::size_t count() const { return jobs_.size(); }

  Status start(const ProcessJob& job, std::size_t index) {
    std::error_code ignored;
    std::filesystem::remove_all(job.folder, ignored);  // files of an earlier process must not pass for its results
    if (Status made = make_folder(job.folder); !made) return made;
    const std::string log = job.log().string();
    std::vector<char*> arguments{const_cast<char*>("epiline")};
    for (const std::string& argument : job.arguments) arguments.push_back(const_cast<char*>(argument.c_str()));
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&attributes);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
    posix_spawnattr_setsigmask(&attributes, &signals_.before());
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    pid_t pid = 0;
    // The running file, even if a build has replaced it meanwhile.
    const int error = posix_spawn(&pid, "/proc/self/exe", &files, &attributes, arguments.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (error != 0) {
      return Error{ErrorKind::kRun, log, 0, std::string("a process cannot be started (") + std::strerror(error) + ")",
                   "free memory, and a writable log file"};
    }
    jobs_[pid] = index;
    return Done{};
  }

  /// Notes those that have ended.
  void collect(std::vector<ProcessEnd>& ends) {
    int status = 0;
    for (pid_t pid = 0; (pid = waitpid(-1, &status, WNOHANG)) > 0;) {
      const auto found = jobs_.find(pid);
      if (found == jobs_.end()) continue;
      ends[found->second] = {WIFEXITED(status) ? WEXITSTATUS(status) : 0, WIFSIGNALED(status) ? WTERMSIG(status) : 0};
      jobs_.erase(found);
    }
  }

 private:
  const HeldSignals& signals_;
  std::map<pid_t, std::size_t> jobs_;
};

}  // namespace

Result<std::vector<ProcessEnd>> run_processes(const std::vector<ProcessJob>& jobs, int side_by_side,
                                              const std::function<void(std::size_t, std::size_t)>& progress) {
  const HeldSignals signals;
  Children children(signals);
  std::vector<ProcessEnd> ends(jobs.size());
  const auto most = static_cast<std::size_t>(std::max(1, side_by_side));
  for (std::size_t next = 0; next < jobs.size() || children.count() > 0;) {
    if (next < jobs.size() && children.count() < most) {
      if (const Status started = children.start(jobs[next], next); !started) return started.error();
      ++next;
      continue;
    }
    const int signal = signals.next();
    if (signal != SIGCHLD) {
      note_end_signal(signal);
      const std::size_t done = next - children.count();
      return Error{ErrorKind::kRun, "", 0,
                   "interrupted after " + std::to_string(done) + " of " + std::to_string(jobs.size()) +
                       " runs, each of which has a folder of its own",
                   ""};
    }
    children.collect(ends);
    progress(next - children.count(), jobs.size());
  }
  return ends;
}

}  // namespace epiline

#include "tests/support/running_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace graspmap_test {

namespace {

// An unnamed file for one of the program's output streams. Unlike a pipe, it never blocks.
class Capture {
 public:
  Capture() : file_(std::tmpfile(), &std::fclose) {
    if (!file_) throw std::runtime_error("no temporary file");
  }
  int descriptor() const { return fileno(file_.get()); }
  std::string text() const {
    std::string text;
    std::vector<char> buffer(1 << 16);
    std::rewind(file_.get());
    while (const std::size_t got = std::fread(buffer.data(), 1, buffer.size(), file_.get()))
      text.append(buffer.data(), got);
    return text;
  }

 private:
  std::unique_ptr<FILE, int (*)(FILE*)> file_;
};

class SpawnActions {
 public:
  SpawnActions() { posix_spawn_file_actions_init(&actions_); }
  ~SpawnActions() { posix_spawn_file_actions_destroy(&actions_); }
  SpawnActions(const SpawnActions&) = delete;
  SpawnActions& operator=(const SpawnActions&) = delete;
  posix_spawn_file_actions_t* get() { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_{};
};

std::vector<std::string> environment_with(const std::map<std::string, std::string>& changes) {
  std::map<std::string, std::string> variables;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string text = *entry;
    const std::size_t equals = text.find('=');
    if (equals != std::string::npos) variables[text.substr(0, equals)] = text.substr(equals + 1);
  }
  for (const auto& [name, value] : changes) variables[name] = value;
  std::vector<std::string> entries;
  for (const auto& [name, value] : variables) entries.push_back(name + "=" + value);
  return entries;
}

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

struct RunningProgram::State {
  Capture output;
  Capture error;
  pid_t process = 0;

  void start(const std::vector<std::string>& words, const ProgramSurroundings& surroundings,
             bool own_group) {
    SpawnActions actions;
    posix_spawn_file_actions_addopen(actions.get(), STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(actions.get(), output.descriptor(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(actions.get(), error.descriptor(), STDERR_FILENO);
    if (!surroundings.folder.empty())
      posix_spawn_file_actions_addchdir_np(actions.get(), surroundings.folder.c_str());
    posix_spawnattr_t attributes{};
    posix_spawnattr_init(&attributes);
    if (own_group) posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    std::vector<std::string> arguments = words;
    std::vector<std::string> environment = environment_with(surroundings.environment);
    const int code = posix_spawn(&process, words.at(0).c_str(), actions.get(), &attributes,
                                 pointers_to(arguments).data(), pointers_to(environment).data());
    posix_spawnattr_destroy(&attributes);
    if (code != 0) throw std::runtime_error(words[0] + ": " + std::strerror(code));
  }

  int wait() {
    int status = 0;
    while (waitpid(process, &status, 0) < 0)
      if (errno != EINTR) throw std::runtime_error("cannot wait for the program");
    process = 0;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  }
};

RunningProgram::RunningProgram(const std::vector<std::string>& words,
                               const ProgramSurroundings& surroundings, bool own_group)
    : state_(std::make_unique<State>()) {
  state_->start(words, surroundings, own_group);
}

RunningProgram::~RunningProgram() {
  if (state_->process == 0) return;
  kill(state_->process, SIGKILL);
  state_->wait();
}

pid_t RunningProgram::process() const { return state_->process; }

bool RunningProgram::has_ended() const {
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(state_->process), &info, WEXITED | WNOHANG | WNOWAIT) ==
             0 &&
         info.si_pid != 0;
}

ProgramResult RunningProgram::wait() {
  const int exit_code = state_->wait();
  return {exit_code, state_->output.text(), state_->error.text()};
}

}  // namespace graspmap_test

#include "tests/support/run_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace graspmap_test {

namespace {

// A file without a name that takes one of the program's output streams: unlike a pipe it never
// blocks, however much is written.
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

int wait_for(pid_t process) {
  int status = 0;
  while (waitpid(process, &status, 0) < 0)
    if (errno != EINTR) throw std::runtime_error("cannot wait for the program");
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace

ProgramResult run_program(const std::vector<std::string>& words,
                          const ProgramSurroundings& surroundings) {
  const Capture output;
  const Capture error;
  SpawnActions actions;
  posix_spawn_file_actions_addopen(actions.get(), STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(actions.get(), output.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(actions.get(), error.descriptor(), STDERR_FILENO);
  if (!surroundings.folder.empty())
    posix_spawn_file_actions_addchdir_np(actions.get(), surroundings.folder.c_str());
  std::vector<std::string> arguments = words;
  std::vector<std::string> environment = environment_with(surroundings.environment);
  pid_t process = 0;
  const int code = posix_spawn(&process, words.at(0).c_str(), actions.get(), nullptr,
                               pointers_to(arguments).data(), pointers_to(environment).data());
  if (code != 0) throw std::runtime_error(words[0] + ": " + std::strerror(code));
  const int exit_code = wait_for(process);
  return {exit_code, output.text(), error.text()};
}

}  // namespace graspmap_test

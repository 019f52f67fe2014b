#include "libmap/core/sandboxed_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

#include "libmap/core/error.h"

namespace libmap {

namespace {

// Sanitizers map terabytes for themselves.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool is_sanitized = true;
#elif defined(__has_feature)
constexpr bool is_sanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
constexpr bool is_sanitized = false;
#endif

void write_all(int pipe, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(pipe, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) _exit(0);  // The parent has closed the pipe.
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

// Suppresses what libraries write to the terminal: the Error reports the failure.
void be_silent() {
  const int null = open("/dev/null", O_WRONLY);
  if (null < 0) return;
  dup2(null, STDOUT_FILENO);
  dup2(null, STDERR_FILENO);
}

void bound_memory(std::uint64_t max_data_bytes) {
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  if (is_sanitized) return;
  const rlimit limit{max_data_bytes, max_data_bytes};
  setrlimit(RLIMIT_DATA, &limit);
}

[[noreturn]] void serve(int pipe, std::uint64_t max_data_bytes,
                        const std::function<void(const SandboxedProcess::Write&)>& work) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGPIPE}) std::signal(signal, SIG_DFL);
  // The child ends with its parent: a signal to both must not look like damaged input.
  for (const int signal : {SIGHUP, SIGINT, SIGTERM}) std::signal(signal, SIG_IGN);
  be_silent();
  bound_memory(max_data_bytes);
  try {
    work([&](std::string_view bytes) { write_all(pipe, bytes); });
  } catch (...) {
    // The parent detects the failure by the missing bytes.
  }
  _exit(0);
}

}  // namespace

void SandboxedProcess::CloseFile::operator()(std::FILE* file) const { std::fclose(file); }

SandboxedProcess::SandboxedProcess(std::uint64_t max_data_bytes,
                                   const std::function<void(const Write&)>& work) {
  int ends[2] = {-1, -1};
  if (pipe2(ends, O_CLOEXEC) == 0) {
    process_ = fork();
    if (process_ == 0) {
      close(ends[0]);
      serve(ends[1], max_data_bytes, work);
    }
    close(ends[1]);
    pipe_.reset(fdopen(ends[0], "rb"));
  }
  if (process_ < 0 || !pipe_)
    throw Error(std::strerror(errno), {.field = "start of a child process"}, ErrorKind::failed);
}

SandboxedProcess::~SandboxedProcess() { end(); }

bool SandboxedProcess::read(void* bytes, std::size_t count) {
  return count == 0 || std::fread(bytes, count, 1, pipe_.get()) == 1;
}

std::string SandboxedProcess::end() {
  pipe_.reset();  // ends a child that still writes
  int status = 0;
  if (process_ > 0)
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) continue;
  process_ = -1;
  return WIFSIGNALED(status) ? " (signal " + std::to_string(WTERMSIG(status)) + ")" : "";
}

void SandboxWriter::error(const Error* error) {
  array(error == nullptr ? std::string() : error->reason());
  if (error == nullptr) return;
  for (const std::string& text :
       {error->context().field, error->context().value, error->context().bound})
    array(text);
  value(error->kind());
}

void SandboxReader::error() {
  std::string reason;
  array(reason);
  if (reason.empty()) return;
  ErrorContext context;
  for (std::string* text : {&context.field, &context.value, &context.bound}) array(*text);
  ErrorKind kind = ErrorKind::bad_input;
  value(kind);
  throw Error(reason, context, kind);
}

}  // namespace libmap

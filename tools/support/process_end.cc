#include "tools/support/process_end.h"

#include <fcntl.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <future>
#include <iostream>
#include <thread>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/output_lock.h"

namespace graspmap_tools {

namespace {

// Signal handlers use global variables only. The pipe remains open until the process ends.
int told_end = -1;
std::atomic<bool> is_told = false;
static_assert(std::atomic<bool>::is_always_lock_free);

// Notifies a thread, because a signal handler may not remove files.
extern "C" void tell(int signal) {
  const int code = errno;
  is_told = true;
  const auto number = static_cast<unsigned char>(signal);
  if (write(told_end, &number, 1) != 1) _exit(128 + signal);
  errno = code;
}

// Ends the process by the signal, because POSIX has no other exit status for it.
[[noreturn]] void end_by(int signal) {
  std::signal(signal, SIG_DFL);
  sigset_t only;
  sigemptyset(&only);
  sigaddset(&only, signal);
  pthread_sigmask(SIG_UNBLOCK, &only, nullptr);
  raise(signal);
  _exit(128 + signal);
}

void wait_for_a_signal(int end, std::promise<void> begun) {
  begun.set_value();
  unsigned char number = 0;
  while (read(end, &number, 1) != 1) {
    if (errno != EINTR) return;
  }
  libmap::abandon_unfinished_outputs();
  end_by(number);
}

void take(int signal) {
  struct sigaction before {};
  if (sigaction(signal, nullptr, &before) != 0 || before.sa_handler == SIG_IGN) return;
  struct sigaction action {};
  action.sa_handler = tell;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(signal, &action, nullptr);
}

}  // namespace

void end_cleanly_on_signals() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw libmap::Error(std::string("cannot create a pipe for signals: ") + std::strerror(errno),
                        {}, libmap::ErrorKind::failed);
  told_end = ends[1];
  // Waits until the thread has begun, because a process forked before would inherit its locks.
  std::promise<void> begun;
  const std::future<void> has_begun = begun.get_future();
  std::thread(wait_for_a_signal, ends[0], std::move(begun)).detach();
  has_begun.wait();
  for (const int signal : {SIGHUP, SIGINT, SIGTERM}) take(signal);
  std::signal(SIGXFSZ, SIG_IGN);
}

void exit_if_signaled() {
  while (is_told) pause();
}

void require_printed() {
  errno = 0;
  std::cout.flush();
  std::fflush(stdout);
  // Failed writes are visible in the streams' state only.
  if (std::cout && std::ferror(stdout) == 0) return;
  // The cause of an earlier failed write is lost, but writing again fails for the same cause.
  const bool is_known = errno != 0 || write(STDOUT_FILENO, "\n", 1) < 0;
  throw libmap::system_failure("standard output", "cannot be written", is_known ? errno : 0);
}

int exit_code_of_printing(const std::string& program) {
  try {
    require_printed();
    return 0;
  } catch (const libmap::Error& error) {
    std::cerr << program << ": error: " << error.what() << "\n";
    return 1;
  }
}

}  // namespace graspmap_tools

#include "libmap/core/unfinished_outputs.h"

#include <chrono>
#include <set>
#include <string>
#include <thread>

#include "libmap/core/output_lock.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// A signal ends the whole process, so this is of the whole process. It is never destroyed: threads
// may outlast main.
struct Unfinished {
  std::recursive_mutex mutex;
  std::set<fs::path> temporaries;
};

Unfinished& unfinished() {
  static auto* const all = new Unfinished;
  return *all;
}

// Other threads may go on filling a folder by its name: under another one it is theirs no more, but
// for the files that they are just opening.
void remove_whole(const fs::path& path) {
  constexpr int tries = 100;
  std::error_code code;
  fs::path doomed = path;
  if (fs::is_directory(fs::symlink_status(path, code))) {
    doomed += ".gone";
    fs::rename(path, doomed, code);
    if (code) doomed = path;
  }
  for (int n = 0; n < tries; ++n) {
    fs::remove_all(doomed, code);
    if (!code) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace

OutputsInStep::OutputsInStep() : lock_(unfinished().mutex) {}

void commit_together(std::vector<OutputFile>& outputs) {
  for (const OutputFile& output : outputs) sync_file(output.temporary_path());
  const OutputsInStep step;
  for (OutputFile& output : outputs) output.commit();
}

void abandon_unfinished_outputs() {
  unfinished().mutex.lock();
  // Twice, for files that a thread opened by their name in the meantime.
  for (int n = 0; n < 2; ++n)
    for (const fs::path& temporary : unfinished().temporaries) remove_whole(temporary);
}

bool is_named_unfinished(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.starts_with('.') && name.find(".partial") != std::string::npos;
}

void add_unfinished_output(const fs::path& temporary) {
  unfinished().temporaries.insert(temporary);
}

void drop_unfinished_output(const fs::path& temporary) {
  unfinished().temporaries.erase(temporary);
}

}  // namespace libmap

#include "libmap/core/file_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_size.h"
#include "libmap/core/named_output.h"
#include "libmap/core/output_lock.h"
#include "libmap/core/unfinished_outputs.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

int open_file(const char* path) {
  return open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
}

}  // namespace

OutputFile::OutputFile(fs::path final_path) : final_path_(std::move(final_path)) {
  if (final_path_.filename().empty() || fs::is_directory(final_path_))
    throw Error("is a folder, not a file", {.file = final_path_.string()});
  // A device or a pipe would be replaced by a file of its name.
  if (fs::exists(final_path_) && !fs::is_regular_file(final_path_))
    throw Error("is not a regular file", {.file = final_path_.string()});
  const fs::path folder = folder_of(final_path_);
  if (!fs::is_directory(folder))
    throw Error("no such folder: " + folder.string(), {.file = final_path_.string()});
  // The extension stays at the end: writers choose the format by it.
  temporary_path_ =
      folder / ("." + final_path_.stem().string() + ".partial" + final_path_.extension().string());
  const OutputsInStep step;
  lock_ = lock_temporary(temporary_path_, final_path_, open_file);
  add_unfinished_output(temporary_path_);
}

OutputFile::~OutputFile() {
  if (lock_ < 0) return;
  const OutputsInStep step;
  std::error_code ignored;
  fs::remove(temporary_path_, ignored);
  drop_unfinished_output(temporary_path_);
  close(lock_);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : final_path_(std::move(other.final_path_)),
      temporary_path_(std::move(other.temporary_path_)),
      lock_(std::exchange(other.lock_, -1)) {}

void OutputFile::commit() {
  sync_file(temporary_path_);
  const OutputsInStep step;
  std::error_code code;
  fs::rename(temporary_path_, final_path_, code);
  if (code) throw system_failure(final_path_, "cannot be put in place", code.value());
  drop_unfinished_output(temporary_path_);
  close(std::exchange(lock_, -1));
  sync_file(folder_of(final_path_));
}

void write_text(const fs::path& path, std::string_view content) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  file.flush();
  if (!file) throw system_failure(path, "cannot be written", errno);
}

void write_whole_file(const fs::path& path, std::string_view content) {
  OutputFile output(path);
  write_named(output.temporary_path(), path,
              [&](const fs::path& temporary) { write_text(temporary, content); });
  output.commit();
}

void require_readable_file(const fs::path& path) {
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (status.type() == fs::file_type::not_found)
    throw Error("no such file", {.file = path.string()});
  if (code) throw Error(code.message(), {.file = path.string()});
  if (status.type() == fs::file_type::directory)
    throw Error("is a folder, not a file", {.file = path.string()});
  if (status.type() != fs::file_type::regular)
    throw Error("is not a regular file", {.file = path.string()});
  if (access(path.c_str(), R_OK) != 0)
    throw Error(std::string("cannot be read: ") + std::strerror(errno), {.file = path.string()});
}

std::string read_whole_file(const fs::path& path, std::uint64_t max_bytes) {
  require_readable_file(path);
  require_file_size(path, max_bytes);
  const std::uint64_t bytes = fs::file_size(path);
  std::string content(bytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(content.data(), static_cast<std::streamsize>(bytes));
  if (!file) throw Error("cannot be read", {.file = path.string()});
  return content;
}

}  // namespace libmap

// Files that appear whole or not at all, and whole files in.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace libmap {

// One output file in the making. Write to temporary_path(), which has the extension of the final
// one and lies beside it; commit() syncs it and renames it onto the final path. Without a commit
// the temporary is removed and an earlier output stays as it was. While it lives, a second process
// that wants to write the same output gets an Error.
class OutputFile {
 public:
  // Throws Error if the folder does not exist or cannot be written to, or the path is a folder or
  // anything else that is no regular file.
  explicit OutputFile(std::filesystem::path final_path);
  ~OutputFile();
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;

  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  const std::filesystem::path& final_path() const { return final_path_; }
  void commit();  // throws Error (failed) if the file cannot be synced or renamed

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
  int lock_ = -1;
};

// `content` straight to `path`, for callers that hold an OutputFile. Throws Error (failed).
void write_text(const std::filesystem::path& path, std::string_view content);

// `content` as a whole file, through an OutputFile.
void write_whole_file(const std::filesystem::path& path, std::string_view content);

// Throws Error: no such file, a folder, not readable, or larger than `max_bytes`.
std::string read_whole_file(const std::filesystem::path& path,
                            std::uint64_t max_bytes = std::uint64_t{1} << 30);

// Throws Error with one clear reason unless `path` is a file that can be read.
void require_readable_file(const std::filesystem::path& path);

}  // namespace libmap

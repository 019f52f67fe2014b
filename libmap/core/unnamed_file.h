// Bytes kept on disk while a program runs, in a file without a name: nothing is left of it, however
// the process ends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>

namespace libmap {

class UnnamedFile {
 public:
  // Throws Error (failed): no file can be made in the folder.
  explicit UnnamedFile(std::filesystem::path folder);
  ~UnnamedFile();
  UnnamedFile(const UnnamedFile&) = delete;
  UnnamedFile& operator=(const UnnamedFile&) = delete;

  // Both may be called from several threads, and throw Error (failed). Where the bytes begin that
  // were appended; what was appended there.
  std::uint64_t append(const void* bytes, std::size_t count);
  void read(std::uint64_t begin, void* bytes, std::size_t count) const;

 private:
  std::filesystem::path folder_;
  int file_ = -1;
  std::mutex mutex_;
  std::uint64_t end_ = 0;
};

}  // namespace libmap

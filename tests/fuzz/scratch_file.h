// File in memory for readers that take paths, rewritten for each input.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace graspmap_fuzz {

class ScratchFile {
 public:
  // `name` may contain a folder. The file is in a folder of this process, which is removed when the
  // process ends normally.
  explicit ScratchFile(const std::string& name);

  const std::filesystem::path& path() const { return path_; }
  void write(std::string_view bytes) const;

 private:
  std::filesystem::path path_;
};

}  // namespace graspmap_fuzz

// A file in memory for readers that take paths, written anew for every input.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace graspmap_fuzz {

class ScratchFile {
 public:
  // `name` may hold a folder. It lies in a folder of this process, which goes when the process
  // ends well.
  explicit ScratchFile(const std::string& name);

  const std::filesystem::path& path() const { return path_; }
  void write(std::string_view bytes) const;

 private:
  std::filesystem::path path_;
};

}  // namespace graspmap_fuzz

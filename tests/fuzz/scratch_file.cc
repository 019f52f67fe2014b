#include "tests/fuzz/scratch_file.h"

#include <unistd.h>

#include <fstream>
#include <stdexcept>

namespace graspmap_fuzz {

namespace fs = std::filesystem;

namespace {

// In memory where the machine has such a folder: fuzzers write thousands of files a second.
class ScratchFolder {
 public:
  ScratchFolder()
      : path((fs::is_directory("/dev/shm") ? "/dev/shm" : fs::temp_directory_path()) /
             ("graspmap-fuzz-" + std::to_string(getpid()))) {
    fs::create_directories(path);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  fs::path path;
};

}  // namespace

ScratchFile::ScratchFile(const std::string& name) {
  static const ScratchFolder folder;
  path_ = folder.path / name;
  fs::create_directories(path_.parent_path());
}

void ScratchFile::write(std::string_view bytes) const {
  std::ofstream file(path_, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file) throw std::runtime_error("cannot write " + path_.string());
}

}  // namespace graspmap_fuzz

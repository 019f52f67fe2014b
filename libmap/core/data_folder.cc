#include "libmap/core/data_folder.h"

#include <dlfcn.h>

#include <algorithm>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"

namespace libmap {

namespace fs = std::filesystem;

fs::path data_folder() {
  // PREFIX/lib/.../graspmap/libgraspmap_core.so: the number of folders below PREFIX differs between
  // systems.
  Dl_info library;
  if (dladdr(reinterpret_cast<void*>(&data_folder), &library) != 0) {
    std::error_code code;
    fs::path prefix = fs::canonical(library.dli_fname, code).parent_path();
    for (int up = 0; up < 4 && !code; ++up) {
      prefix = prefix.parent_path();
      if (fs::is_directory(prefix / "share/graspmap", code)) return prefix / "share/graspmap";
      code.clear();
    }
  }
  return GRASPMAP_SOURCE_DATA;
}

fs::path find_data_file(const std::string& kind, const std::string& name) {
  if (name.find('/') != std::string::npos || name.ends_with(".yaml")) {
    require_readable_file(name);
    return name;
  }
  const fs::path folder = data_folder() / kind;
  fs::path file = folder / (name + ".yaml");
  if (fs::is_regular_file(file)) return file;
  std::vector<std::string> known;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".yaml") known.push_back(entry.path().stem().string());
  std::sort(known.begin(), known.end());
  std::string names;
  for (const std::string& one : known) names += (names.empty() ? "" : ", ") + one;
  throw Error("neither a file nor one of " + names + did_you_mean(name, known),
              {.field = kind.substr(0, kind.size() - 1), .value = name});
}

}  // namespace libmap

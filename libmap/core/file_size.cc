#include "libmap/core/file_size.h"

#include <unistd.h>

#include <string>
#include <system_error>

#include "libmap/core/error.h"

namespace libmap {

namespace fs = std::filesystem;

std::uint64_t machine_memory() {
  return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

void require_file_size(const fs::path& path, std::uint64_t max_bytes) {
  std::error_code code;
  const std::uint64_t bytes = fs::file_size(path, code);
  if (code) throw Error(code.message(), {.file = path.string()});
  if (bytes > max_bytes)
    throw Error("too large to be read whole", {.file = path.string(),
                                               .field = "size",
                                               .value = std::to_string(bytes) + " bytes",
                                               .bound = "<= " + std::to_string(max_bytes)});
}

}  // namespace libmap

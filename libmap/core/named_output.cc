#include "libmap/core/named_output.h"

#include <string>

namespace libmap {

namespace fs = std::filesystem;

Error naming(const Error& error, const fs::path& file) {
  ErrorContext context = error.context();
  context.file = file.string();
  return Error(error.reason(), context, error.kind());
}

void write_named(const fs::path& temporary, const fs::path& output,
                 const std::function<void(const fs::path&)>& write) {
  try {
    write(temporary);
  } catch (const Error& error) {
    const std::string& file = error.context().file;
    const std::string within = temporary.string() + "/";
    if (file == temporary.string()) throw naming(error, output);
    if (file.starts_with(within)) throw naming(error, output / file.substr(within.size()));
    throw;
  }
}

}  // namespace libmap

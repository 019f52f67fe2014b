#include "libmap/report/run_folder.h"

#include <algorithm>
#include <system_error>

#include "libmap/core/error.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// The run of digits at `at`, without leading zeros; `at` moves behind it.
std::string_view digits_at(std::string_view text, std::size_t& at) {
  while (at < text.size() && text[at] == '0') ++at;
  const std::size_t begin = at;
  while (at < text.size() && is_digit(text[at])) ++at;
  return text.substr(begin, at - begin);
}

void add_manifests(const fs::path& folder, bool shares, int depth,
                   std::vector<ReportSource>& sources) {
  const FolderListing listing = list_folder(folder);
  for (const fs::path& file : listing.files) {
    if (file.extension() != ".json") continue;
    fs::path output = file;
    output.replace_extension();
    std::error_code code;
    if (!fs::exists(output, code)) continue;
    ReportSource& source = sources.emplace_back();
    source.output = output.string();
    try {
      if (auto manifest = read_manifest_of(output)) source.manifest = std::move(*manifest);
    } catch (const Error& error) {
      source.error = error.reason();
    }
  }
  if (depth == max_folder_depth) return;
  for (const fs::path& inner : listing.folders)
    if (inner.extension() != ".tiles" && (shares || !is_folder_of_tiles(inner)))
      add_manifests(inner, shares, depth + 1, sources);
}

}  // namespace

bool natural_less(std::string_view a, std::string_view b) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::string_view first = digits_at(a, i);
      const std::string_view second = digits_at(b, j);
      if (first.size() != second.size()) return first.size() < second.size();
      if (first != second) return first < second;
      continue;
    }
    if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
    ++i;
    ++j;
  }
  if ((i == a.size()) != (j == b.size())) return i == a.size();
  return a < b;
}

FolderListing list_folder(const fs::path& folder) {
  FolderListing listing;
  std::error_code code;
  for (auto entry = fs::directory_iterator(folder, code);
       !code && entry != fs::directory_iterator(); entry.increment(code)) {
    std::error_code ignored;
    if (entry->path().filename().string().starts_with('.')) continue;
    if (entry->is_directory(ignored)) {
      if (!entry->is_symlink(ignored)) listing.folders.push_back(entry->path());
    } else if (entry->is_regular_file(ignored)) {
      listing.files.push_back(entry->path());
    }
  }
  const auto by_name = [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  };
  std::sort(listing.files.begin(), listing.files.end(), by_name);
  std::sort(listing.folders.begin(), listing.folders.end(), by_name);
  return listing;
}

bool is_folder_of_tiles(const fs::path& folder) {
  return folder.extension() == ".tiles" || folder.filename() == "tiles";
}

std::vector<ReportSource> manifests_below(const fs::path& folder, bool shares) {
  std::vector<ReportSource> sources;
  add_manifests(folder, shares, 0, sources);
  return sources;
}

}  // namespace libmap

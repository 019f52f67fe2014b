#include "libmap/cloud/pcd_parts.h"

#include <cerrno>
#include <sstream>
#include <string>
#include <utility>

#include "libmap/cloud/cloud_columns.h"
#include "libmap/cloud/pcd_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/output_lock.h"

namespace libmap {

namespace {

std::string encoded(const PointCloud& part, bool float64_positions) {
  ColumnSet set = columns_of_cloud(part, NormalNames::long_names);
  for (Column& column : set.columns)
    if (column.name == "x" || column.name == "y" || column.name == "z")
      column.type = float64_positions ? ScalarType::float64 : ScalarType::float32;
  std::ostringstream out;
  encode_pcd(set, part.viewpoint, FileEncoding::binary, out);
  return std::move(out).str();
}

// The header's end: behind the line DATA.
std::size_t data_begin(const std::string& bytes) {
  return bytes.find('\n', bytes.find("\nDATA ") + 1) + 1;
}

void replace(std::string& text, const std::string& word, const std::string& by) {
  text.replace(text.find(word), word.size(), by);
}

}  // namespace

PcdPartsWriter::PcdPartsWriter(std::filesystem::path path, const PcdPartsOptions& options)
    : path_(std::move(path)), options_(options), file_(path_, std::ios::binary | std::ios::trunc) {
  require_good();
}

void PcdPartsWriter::write(const std::string& bytes) {
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  require_good();
}

// An ofstream tells of a failed open, write or close by its state alone; the system's call that
// failed was the last one.
void PcdPartsWriter::require_good() const {
  if (!file_) throw system_failure(path_, "cannot be written", errno);
}

void PcdPartsWriter::append(const PointCloud& part) {
  if (part.empty()) return;  // it does not say whether the whole has normals and colors
  written_ += part.size();
  if (written_ > options_.points)
    throw Error("contains more points than were promised", {.file = path_.string()});
  const std::string bytes = encoded(part, options_.float64_positions);
  const std::size_t begin = data_begin(bytes);
  std::string header = bytes.substr(0, begin);
  const std::string own = std::to_string(part.size());
  replace(header, "\nWIDTH " + own + "\n", "\nWIDTH " + std::to_string(options_.points) + "\n");
  replace(header, "\nPOINTS " + own + "\n", "\nPOINTS " + std::to_string(options_.points) + "\n");
  if (header_.empty()) {
    write(header);
    header_ = header;
  } else if (header != header_) {
    throw Error("the parts have different fields", {.file = path_.string()});
  }
  write(bytes.substr(begin));
}

void PcdPartsWriter::finish() {
  if (written_ != options_.points)
    throw Error("contains fewer points than were promised", {.file = path_.string()});
  file_.close();
  require_good();
}

}  // namespace libmap

#include "tests/support/reference_data.h"

#include <zlib.h>

#include <bit>
#include <charconv>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string_view>

namespace graspmap_test {

namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little);

[[noreturn]] void fail(const fs::path& path, const std::string& why) {
  throw std::runtime_error(path.string() + ": " + why);
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (!text.empty()) {
    const std::size_t end = text.find(separator);
    if (end != 0) parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) break;
    text.remove_prefix(end + 1);
  }
  return parts;
}

template <typename T>
T number(const fs::path& path, std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    fail(path, std::string(text) + " is not a number");
  return value;
}

template <typename T, int n>
Eigen::Matrix<T, n, 1> vector_at(const fs::path& path, const std::vector<std::string_view>& words,
                                 std::size_t first) {
  Eigen::Matrix<T, n, 1> value;
  for (int a = 0; a < n; ++a)
    value[a] = number<T>(path, words.at(first + static_cast<std::size_t>(a)));
  return value;
}

std::string read_plain(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) fail(path, "cannot be opened");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

std::string read_gz(const fs::path& path) {
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) fail(path, "cannot be opened");
  std::string data;
  std::vector<char> buffer(1 << 18);
  int got = 0;
  while ((got = gzread(file, buffer.data(), static_cast<unsigned>(buffer.size()))) > 0)
    data.append(buffer.data(), static_cast<std::size_t>(got));
  const bool good = got == 0 && gzclose(file) == Z_OK;
  if (!good) fail(path, "cannot be unpacked");
  return data;
}

std::vector<Eigen::Vector3f> read_points_f32_gz(const fs::path& path) {
  const std::string data = read_gz(path);
  if (data.size() % 12 != 0) fail(path, "does not contain triples of float32");
  std::vector<Eigen::Vector3f> points(data.size() / 12);
  for (std::size_t i = 0; i < points.size(); ++i)
    std::memcpy(points[i].data(), data.data() + 12 * i, 12);
  return points;
}

ReferenceScores read_scores_gz(const fs::path& path) {
  const std::string data = read_gz(path);
  ReferenceScores scores;
  for (const std::string_view line : split(data, '\n')) {
    if (line.front() == '#' || line.front() == 'i') continue;
    const auto words = split(line, ',');
    if (words.size() != 6) fail(path, "a line has not six columns");
    std::array<int, 5> row;
    for (std::size_t c = 0; c < 5; ++c) row[c] = number<int>(path, words[c]);
    scores.rows.push_back(row);
    scores.score_percent.push_back(number<double>(path, words[5]));
  }
  return scores;
}

ReferenceVoxels read_voxels_gz(const fs::path& path) {
  const std::string data = read_gz(path);
  ReferenceVoxels result;
  for (const std::string_view line : split(data, '\n')) {
    if (line.front() == 'i') continue;
    if (line.front() == '#') {  // "# dims 429 424 70, occupied 72472"
      const auto words = split(line.substr(0, line.find(',')), ' ');
      for (std::size_t a = 0; a < 3; ++a) result.dims[a] = number<int>(path, words.at(a + 2));
      continue;
    }
    const auto words = split(line, ',');
    if (words.size() != 3) fail(path, "a line has not three columns");
    result.voxels.push_back(
        {number<int>(path, words[0]), number<int>(path, words[1]), number<int>(path, words[2])});
  }
  return result;
}

ReferenceMask read_mask(const fs::path& path) {
  const std::string data = read_plain(path);
  ReferenceMask mask;
  for (const std::string_view line : split(data, '\n')) {
    if (line.front() == '#' || line.front() == 'z') continue;
    if (mask.dims[0] == 0) {
      const auto words = split(line, ' ');
      for (std::size_t a = 0; a < 3; ++a) mask.dims[a] = number<int>(path, words.at(a));
      continue;
    }
    for (const char c : line) mask.cells.push_back(c == '1' ? 1 : 0);
  }
  if (mask.cells.size() != static_cast<std::size_t>(mask.dims[0]) *
                               static_cast<std::size_t>(mask.dims[1]) *
                               static_cast<std::size_t>(mask.dims[2]))
    fail(path, "has not as many cells as its dimensions say");
  return mask;
}

ReferenceFrame read_frame(const fs::path& path) {
  const std::string data = read_plain(path);
  ReferenceFrame frame;
  int rotation_rows_left = 0;
  for (const std::string_view line : split(data, '\n')) {
    const auto words = split(line, ' ');
    const std::string_view key = words.front();
    if (rotation_rows_left > 0) {
      frame.rotation.row(3 - rotation_rows_left--) =
          vector_at<double, 3>(path, words, 0).transpose();
    } else if (key == "points_in") {
      frame.points_in = number<int>(path, words.at(1));
    } else if (key == "downsampled") {
      frame.downsampled = number<int>(path, words.at(1));
    } else if (key == "centroid") {
      frame.centroid = vector_at<double, 3>(path, words, 1);
    } else if (key.starts_with("rotation_rows")) {
      rotation_rows_left = 3;
    } else if (key == "min_of_voxelized_cloud") {
      frame.min_of_voxelized = vector_at<double, 3>(path, words, 1);
    } else if (key == "GS") {
      frame.grid_spacing = number<double>(path, words.at(1));
      frame.x_width = number<double>(path, words.at(3));
      frame.y_width = number<double>(path, words.at(5));
    } else if (key == "interpolated") {
      frame.interpolated_count = number<int>(path, words.at(1));
    } else if (key.starts_with("transformed[")) {
      frame.transformed.push_back(vector_at<float, 3>(path, words, 1));
    } else if (key.starts_with("interpolated[")) {
      frame.interpolated.push_back(vector_at<float, 3>(path, words, 1));
    }
  }
  return frame;
}

}  // namespace graspmap_test

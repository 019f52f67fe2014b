#include "libmap/cloud/cloud_pieces.h"

#include <algorithm>
#include <fstream>
#include <utility>

#include "libmap/cloud/cloud_columns.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/pcd_codec.h"
#include "libmap/cloud/ply_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t max_block_bytes = std::size_t{1} << 22;

// The first MiB, more than any header, of a file of so many bytes.
std::string read_head(std::ifstream& file, std::uint64_t bytes) {
  std::string head(std::min<std::uint64_t>(bytes, 1 << 20), '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  file.clear();
  return head;
}

void append_points(const PointCloud& from, std::size_t begin, std::size_t end, PointCloud& to) {
  const auto add = [&](const auto& source, auto& target) {
    if (source.empty()) return;
    target.insert(target.end(), source.begin() + static_cast<std::ptrdiff_t>(begin),
                  source.begin() + static_cast<std::ptrdiff_t>(end));
  };
  add(from.positions, to.positions);
  add(from.normals, to.normals);
}

}  // namespace

struct CloudBlockReader::State {
  fs::path path;
  Pose viewpoint = Pose::Identity();
  bool has_normals = false;
  std::size_t rows_left = 0;
  std::size_t dropped = 0;

  // Records in blocks ...
  std::ifstream file;
  std::vector<std::byte> block;
  std::size_t record_bytes = 0;
  std::vector<Column> columns;
  // ... or the whole file.
  PointCloud whole;

  bool open_records() {
    const std::string format = format_of(path);
    if (format != ".pcd" && format != ".ply") return false;
    file.open(path, std::ios::binary);
    const std::uint64_t bytes = fs::file_size(path);
    const std::string head = read_head(file, bytes);
    // Thousands of small pieces are opened, each more than once.
    block.resize(std::min<std::uint64_t>(bytes, max_block_bytes));
    const auto records = format == ".pcd" ? pcd_records(head, bytes, block.data())
                                          : ply_records(head, bytes, block.data());
    if (!records || records->bytes == 0 || records->bytes > block.size()) {
      std::vector<std::byte>().swap(block);
      return false;
    }
    columns = geometry_columns(records->columns);
    ColumnSet none;
    none.columns = records->columns;
    cloud_from_columns(none, NotFinite::drop);  // throws where there is no x, y or z
    has_normals = columns.size() > 3;
    record_bytes = records->bytes;
    rows_left = records->count;
    viewpoint = records->viewpoint;
    file.seekg(static_cast<std::streamoff>(records->begin));
    return true;
  }

  void read_whole() {
    CloudReadResult read = read_cloud(path);
    dropped = read.dropped_points;
    viewpoint = read.cloud.viewpoint;
    has_normals = read.cloud.has_normals();
    whole.positions = std::move(read.cloud.positions);
    whole.normals = std::move(read.cloud.normals);
    rows_left = whole.size();
  }

  void append_records(std::size_t rows, PointCloud& cloud) {
    while (rows > 0) {
      const std::size_t count = std::min(rows, block.size() / record_bytes);
      file.read(reinterpret_cast<char*>(block.data()),
                static_cast<std::streamsize>(count * record_bytes));
      if (!file) throw Error("cannot be read", {.file = path.string()});
      ColumnSet set;
      set.rows = count;
      set.columns = columns;
      const CloudFromColumns read = cloud_from_columns(set, NotFinite::drop);
      dropped += read.dropped_points;
      append_points(read.cloud, 0, read.cloud.size(), cloud);
      rows -= count;
    }
  }
};

CloudBlockReader::CloudBlockReader(fs::path path) : state_(std::make_unique<State>()) {
  require_cloud_file(path);
  state_->path = std::move(path);
  try {
    if (!state_->open_records()) state_->read_whole();
  } catch (const Error& error) {
    throw error.in_file(state_->path.string());
  }
}
CloudBlockReader::~CloudBlockReader() = default;
CloudBlockReader::CloudBlockReader(CloudBlockReader&&) noexcept = default;

bool CloudBlockReader::is_empty() const { return state_->rows_left == 0; }
bool CloudBlockReader::has_normals() const { return state_->has_normals; }
const Pose& CloudBlockReader::viewpoint() const { return state_->viewpoint; }
std::size_t CloudBlockReader::dropped_points() const { return state_->dropped; }

bool CloudBlockReader::append(std::size_t rows, PointCloud& cloud) {
  rows = std::min(rows, state_->rows_left);
  if (rows == 0) return false;
  if (state_->record_bytes > 0) {
    state_->append_records(rows, cloud);
  } else {
    const std::size_t begin = state_->whole.size() - state_->rows_left;
    append_points(state_->whole, begin, begin + rows, cloud);
  }
  state_->rows_left -= rows;
  return true;
}

void CloudBlockReader::leave_out_normals() {
  state_->columns = position_columns(state_->columns);
  state_->whole.normals.clear();
}

std::vector<fs::path> cloud_pieces(const fs::path& given) {
  if (!fs::is_directory(given)) {
    require_cloud_file(given);
    return {given};
  }
  std::vector<fs::path> pieces;
  for (const fs::directory_entry& entry : fs::directory_iterator(given)) {
    const std::string format = format_of(entry.path());
    // A .vtp is refused when it is opened: a terrain without it would be incomplete.
    const bool is_cloud =
        format == ".pcd" || format == ".ply" || format == ".vtp" || format == ".csv";
    if (is_cloud && entry.is_regular_file() && entry.path().filename().string().front() != '.')
      pieces.push_back(entry.path());
  }
  if (pieces.empty())
    throw Error("the folder contains no cloud (.pcd, .ply, .csv)", {.file = given.string()});
  std::sort(pieces.begin(), pieces.end());
  return pieces;
}

PieceStream::PieceStream(std::vector<fs::path> pieces) : pieces_(std::move(pieces)) {
  bool is_first = true;
  fs::path first;
  for (const fs::path& piece : pieces_) {
    const CloudBlockReader reader(piece);
    if (reader.is_empty()) continue;
    if (is_first) {
      first = piece;
      has_normals_ = reader.has_normals();
      viewpoint_ = reader.viewpoint();
    } else if (reader.has_normals() != has_normals_) {
      throw Error(has_normals_ ? "has no normals, but " + first.string() + " has"
                               : "has normals, but " + first.string() + " has none",
                  {.file = piece.string()});
    } else if (reader.viewpoint().matrix() != viewpoint_.matrix()) {
      viewpoint_ = Pose::Identity();
    }
    is_first = false;
  }
}

void PieceStream::for_each_block(Need need, const Visit& visit) const {
  PointCloud block;
  block.viewpoint = viewpoint_;
  for (const fs::path& piece : pieces_) {
    CloudBlockReader reader(piece);
    if (need == Need::positions) reader.leave_out_normals();
    while (reader.append(block_points - block.size(), block)) {
      if (block.size() < block_points) continue;
      visit(block);
      block.positions.clear();
      block.normals.clear();
    }
  }
  if (!block.empty()) visit(block);
}

PieceFacts survey_piece(const fs::path& piece) {
  PieceFacts facts;
  CloudBlockReader reader(piece);
  reader.leave_out_normals();
  PointCloud block;
  while (reader.append(PointStream::block_points, block)) {
    const Bounds3d box = bounds_of(block.positions);
    if (facts.points == 0) {
      facts.box = box;
    } else if (!block.empty()) {
      facts.box.min = facts.box.min.cwiseMin(box.min);
      facts.box.max = facts.box.max.cwiseMax(box.max);
    }
    facts.points += block.size();
    block.positions.clear();
    block.normals.clear();
  }
  facts.dropped_points = reader.dropped_points();
  return facts;
}

PiecesReadResult read_pieces(const std::vector<fs::path>& pieces) {
  PiecesReadResult result;
  result.cloud.viewpoint = PieceStream(pieces).viewpoint();
  for (const fs::path& piece : pieces) {
    CloudBlockReader reader(piece);
    while (reader.append(PointStream::block_points, result.cloud)) {
    }
    result.dropped_points += reader.dropped_points();
  }
  return result;
}

}  // namespace libmap

#include "libmap/scan/rtabmap_reader.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/error.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr const char* unknown_part = " is unknown and ignored";
// Size sufficient for the frame header of a camera's JPEG.
constexpr std::size_t header_bytes = 4096;

std::string or_empty(std::string blob) { return is_absent(blob) ? std::string() : std::move(blob); }

// Columns of images and calibration: in Data, or before 0.10 in Image and Depth.
struct ImageColumns {
  std::string from;
  std::string id;
  std::string image;
  std::string depth;
  std::string calibration;
  std::string focal_length_x = "NULL";  // before 0.10
  std::string focal_length_y = "NULL";
  std::string center_x = "NULL";
  std::string center_y = "NULL";
  std::string local_transform = "NULL";
  std::string scan = "NULL";
  std::string user_data = "NULL";
};

ImageColumns image_columns(const RtabmapColumns& columns) {
  if (columns.has_table("Data"))
    return {.from = "Data",
            .id = "id",
            .image = columns.or_null("Data", "image"),
            .depth = columns.or_null("Data", "depth"),
            .calibration = columns.or_null("Data", "calibration"),
            .scan = columns.or_null("Data", "scan"),
            .user_data = columns.or_null("Data", "user_data")};
  const bool has_depth = columns.has_table("Depth");
  const auto depth_column = [&](const char* name) {
    return columns.has("Depth", name) ? std::string("Depth.") + name : std::string("NULL");
  };
  return {.from = has_depth ? "Image LEFT OUTER JOIN Depth ON Image.id = Depth.id" : "Image",
          .id = "Image.id",
          .image = columns.has("Image", "data") ? "Image.data" : "NULL",
          .depth = depth_column("data"),
          .calibration = "NULL",
          .focal_length_x = depth_column("fx"),
          .focal_length_y = depth_column("fy"),
          .center_x = depth_column("cx"),
          .center_y = depth_column("cy"),
          .local_transform = depth_column("local_transform"),
          .scan = depth_column("data2d")};
}

std::string calibration_list(const ImageColumns& of) {
  return of.calibration + ", " + of.focal_length_x + ", " + of.focal_length_y + ", " + of.center_x +
         ", " + of.center_y + ", " + of.local_transform;
}

// Reads columns from `first`: calibration fx fy cx cy local_transform; the last five before 0.10.
// An fy below 1 is the baseline of a stereo pair (DBDriverSqlite3.cpp).
std::string calibration_in(const SqliteRow& row, int first) {
  if (!row.is_null(first)) return or_empty(row.bytes(first));
  if (row.is_null(first + 1)) return {};
  std::vector<float> numbers;
  for (int i = 1; i <= 4; ++i) numbers.push_back(static_cast<float>(row.real(first + i)));
  if (numbers[1] < 1) numbers = {numbers[0], numbers[0], numbers[2], numbers[3], numbers[1]};
  std::string local = row.bytes(first + 5);
  if (local.size() != 48) local = std::string(48, '\0');
  std::string bytes(numbers.size() * sizeof(float), '\0');
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes + local;
}

std::string version_of(const SqliteFile& file, const RtabmapColumns& columns) {
  std::string version;
  if (columns.has("Admin", "version"))
    file.each_row("SELECT version FROM Admin LIMIT 1", {},
                  [&](const SqliteRow& row) { version = row.bytes(0); });
  return version;
}

void require_scan(const fs::path& path, const RtabmapColumns& columns) {
  const auto refuse = [&](const std::string& why) {
    throw Error("is an SQLite file but not an RTAB-Map database: " + why, {.file = path.string()});
  };
  if (!columns.has_table("Node")) refuse("no table Node");
  if (!columns.has("Node", "id")) refuse("table Node has no column id");
  if (columns.has_table("Link"))
    for (const char* column : {"from_id", "to_id", "type", "transform"})
      if (!columns.has("Link", column)) refuse(std::string("table Link has no column ") + column);
  for (const char* table : {"Data", "Image", "Depth"})
    if (columns.has_table(table) && !columns.has(table, "id"))
      refuse(std::string("table ") + table + " has no column id");
}

}  // namespace

RgbdFrame decode_frame(const FrameBlobs& blobs, FrameParts parts) {
  RgbdFrame frame;
  // Size of the image that the cameras belong to.
  int width = 0;
  int height = 0;
  if (!blobs.image.empty())
    in_field("image", [&] {
      const std::optional<ImageInfo> info = read_image_info(blobs.image);
      if (!info) throw Error("the image's header is truncated");
      width = info->width;
      height = info->height;
      if (parts.color) frame.color = decode_color(blobs.image);
    });
  if (!blobs.depth.empty())
    in_field("depth", [&] {
      const std::optional<DepthInfo> info = read_depth_info(blobs.depth);
      if (info && parts.depth) frame.depth = decode_depth(blobs.depth);
      if (!info && parts.depth) frame.right = decode_gray(blobs.depth);
      if (info && width == 0) {
        width = info->width;
        height = info->height;
      }
    });
  if (!blobs.calibration.empty())
    in_field("calibration", [&] {
      const Calibration calibration = decode_calibration(blobs.calibration);
      frame.cameras = cameras_of(calibration, width, height);
      frame.stereo = stereo_cameras_of(calibration, width, height);
    });
  return frame;
}

RtabmapDatabase::RtabmapDatabase(const fs::path& path)
    : path_(path), file_(std::make_unique<SqliteFile>(path)), columns_(*file_) {
  require_scan(path, columns_);
  version_ = version_of(*file_, columns_);
  RtabmapGraph read = read_rtabmap_graph(*file_, columns_);
  graph_ = std::move(read.graph);
  warnings_ = std::move(read.warnings);
  if (!columns_.has_table("Data") && !columns_.has_table("Image"))
    warnings_.push_back("no table Data: the scan has no images");
  for (const std::string& name : columns_.unknown()) warnings_.push_back(name + unknown_part);
}

bool is_about_unknown_part(const std::string& warning) { return warning.ends_with(unknown_part); }

RtabmapDatabase::~RtabmapDatabase() = default;

FrameBlobs RtabmapDatabase::read_blobs(int node, FrameParts parts) const {
  if (graph_.find_node(node) == nullptr)
    throw Error("the scan has no node with this id",
                {.file = path_.string(), .field = "node", .value = std::to_string(node)});
  FrameBlobs blobs;
  if (!columns_.has_table("Data") && !columns_.has_table("Image")) return blobs;
  const ImageColumns of = image_columns(columns_);
  // The header of an image that is not requested is read for cameras that do not store their size.
  const auto part = [&](const std::string& column, bool is_wanted) {
    return is_wanted ? column : "substr(" + column + ", 1, " + std::to_string(header_bytes) + ")";
  };
  const std::string query = "SELECT " + part(of.image, parts.color) + ", " +
                            part(of.depth, parts.depth) + ", " + calibration_list(of) + " FROM " +
                            of.from + " WHERE " + of.id + " = ? LIMIT 1";
  file_->each_row(query, {node}, [&](const SqliteRow& row) {
    blobs.image = or_empty(row.bytes(0));
    blobs.depth = or_empty(row.bytes(1));
    blobs.calibration = calibration_in(row, 2);
  });
  return blobs;
}

RgbdFrame RtabmapDatabase::read_frame(int node, FrameParts parts) const {
  FrameBlobs blobs = read_blobs(node, parts);
  try {
    // The header is longer than the bytes read.
    if (!parts.color && !blobs.image.empty() && !read_image_info(blobs.image))
      blobs.image = read_blobs(node).image;
    RgbdFrame frame = decode_frame(blobs, parts);
    frame.node = node;
    frame.stamp_s = graph_.find_node(node)->stamp_s;
    return frame;
  } catch (const Error& error) {
    if (!error.context().file.empty()) throw;
    throw error.in_field("node " + std::to_string(node)).in_file(path_.string());
  }
}

std::map<std::string, std::string> RtabmapDatabase::parameters() const {
  // In 0.11.8 to 0.11.10, they are in Statistics.
  const std::string table = columns_.has("Info", "parameters") ? "Info" : "Statistics";
  std::map<std::string, std::string> parameters;
  if (!columns_.has(table, "parameters")) return parameters;
  std::string text;
  const std::string order = columns_.has(table, "time_enter") ? "time_enter DESC, " : "";
  file_->each_row("SELECT parameters FROM " + table + " WHERE parameters IS NOT NULL ORDER BY " +
                      order + "rowid DESC LIMIT 1",
                  {}, [&](const SqliteRow& row) { text = row.bytes(0); });
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(';', at), text.size());
    const std::string entry = text.substr(at, end - at);
    const std::size_t colon = entry.find(':');
    if (colon != std::string::npos && colon > 0)
      parameters[entry.substr(0, colon)] = entry.substr(colon + 1);
    at = end + 1;
  }
  return parameters;
}

namespace {

std::size_t count_rows(const SqliteFile& file, const std::string& table) {
  std::size_t count = 0;
  file.each_row("SELECT count(*) FROM " + table, {}, [&](const SqliteRow& row) {
    count = static_cast<std::size_t>(std::max<std::int64_t>(row.integer(0), 0));
  });
  return count;
}

std::string feature_table(const RtabmapColumns& columns) {
  for (const char* table : {"Feature", "Map_Node_Word"})
    if (columns.has_table(table)) return table;
  return {};
}

int int_in(const SqliteRow& row, int column) {
  return static_cast<int>(std::clamp<std::int64_t>(
      row.integer(column), std::numeric_limits<int>::min(), std::numeric_limits<int>::max()));
}

}  // namespace

std::size_t RtabmapDatabase::word_count() const {
  return columns_.has_table("Word") ? count_rows(*file_, "Word") : 0;
}

std::size_t RtabmapDatabase::feature_count() const {
  const std::string table = feature_table(columns_);
  return table.empty() ? 0 : count_rows(*file_, table);
}

namespace {

template <typename Read>
void attempt(NodeContent& content, const char* part, const Read& read) {
  try {
    read();
  } catch (const Error& error) {
    content.faults.push_back(std::string(part) + ": " + error.what());
  }
}

void read_headers(NodeContent& content, const std::string& image, const std::string& depth,
                  const std::string& calibration) {
  if (!image.empty()) attempt(content, "image", [&] { content.color = read_image_info(image); });
  if (!depth.empty())
    attempt(content, "depth", [&] {
      content.depth = read_depth_info(depth);
      if (!content.depth) content.right = read_image_info(depth);
    });
  if (!calibration.empty())
    attempt(content, "calibration", [&] { content.calibration = decode_calibration(calibration); });
}

}  // namespace

void RtabmapDatabase::each_content(const std::function<void(const NodeContent&)>& use) const {
  if (!columns_.has_table("Data") && !columns_.has_table("Image")) return;
  const ImageColumns of = image_columns(columns_);
  const auto begin_of = [](const std::string& column) {
    return "substr(" + column + ", 1, " + std::to_string(header_bytes) + "), length(" + column +
           ")";
  };
  file_->each_row("SELECT " + of.id + ", " + begin_of(of.image) + ", " + begin_of(of.depth) +
                      ", length(" + of.scan + "), length(" + of.user_data + "), " +
                      calibration_list(of) + " FROM " + of.from + " ORDER BY " + of.id,
                  {}, [&](const SqliteRow& row) {
                    NodeContent content{.node = int_in(row, 0)};
                    if (graph_.find_node(content.node) == nullptr) return;
                    const auto bytes_in = [&](int column) {
                      const std::int64_t size = row.integer(column);
                      return size > static_cast<std::int64_t>(absent_blob_bytes)
                                 ? static_cast<std::size_t>(size)
                                 : 0;
                    };
                    content.color_bytes = bytes_in(2);
                    content.depth_bytes = bytes_in(4);
                    content.laser_scan_bytes = bytes_in(5);
                    content.user_data_bytes = bytes_in(6);
                    read_headers(content, or_empty(row.bytes(1)), or_empty(row.bytes(3)),
                                 calibration_in(row, 7));
                    use(content);
                  });
}

namespace {

// Counts polygons. Each material is stored as its number of polygons, then their indices.
std::size_t count_polygons(const std::string& blob, std::int64_t corners) {
  std::size_t count = 0;
  std::uint64_t left = 0;  // remaining indices of the material
  for_each_matrix_chunk(blob, [&](std::string_view bytes) {
    for (; bytes.size() >= sizeof(std::int32_t); bytes.remove_prefix(sizeof(std::int32_t))) {
      if (left > 0) {
        --left;
        continue;
      }
      std::int32_t polygons = 0;
      std::memcpy(&polygons, bytes.data(), sizeof polygons);
      if (polygons < 0 || corners < 1 || corners > std::numeric_limits<std::int32_t>::max())
        throw Error("mesh has an invalid size");
      count += static_cast<std::size_t>(polygons);
      left = static_cast<std::uint64_t>(polygons) * static_cast<std::uint64_t>(corners);
    }
  });
  if (left > 0) throw Error("mesh is truncated");
  return count;
}

}  // namespace

StoredMap RtabmapDatabase::stored_map() const {
  StoredMap map;
  if (!columns_.has_table("Admin")) return map;
  std::string list;
  for (const char* name :
       {"opt_map", "opt_map_resolution", "opt_cloud", "opt_polygons", "opt_polygons_size",
        "opt_tex_materials", "preview_image", "opt_last_localization"})
    list += (list.empty() ? "" : ", ") + columns_.or_null("Admin", name);
  std::string field;
  const auto read = [&](const SqliteRow& row) {
    const auto blob = [&](int column, const char* name) {
      field = name;
      return or_empty(row.bytes(column));
    };
    if (const std::string grid = blob(0, "opt_map"); !grid.empty()) {
      const StoredMatrix size = read_matrix_header(grid);
      map.grid_width = size.columns;
      map.grid_height = size.rows;
      map.grid_resolution_m = row.is_null(1) ? 0.0 : row.real(1);
    }
    if (const std::string cloud = blob(2, "opt_cloud"); !cloud.empty()) {
      const StoredMatrix size = read_matrix_header(cloud);
      map.cloud_points =
          static_cast<std::size_t>(size.rows) * static_cast<std::size_t>(size.columns);
    }
    if (const std::string mesh = blob(3, "opt_polygons"); !mesh.empty())
      map.polygons = count_polygons(mesh, row.integer(4));
    if (const std::string texture = blob(5, "opt_tex_materials"); !texture.empty())
      map.texture = read_image_info(texture);
    if (const std::string preview = blob(6, "preview_image"); !preview.empty())
      map.preview = read_image_info(preview);
    if (const std::string pose = blob(7, "opt_last_localization"); !pose.empty())
      map.last_localization_map_from_base = decode_pose(pose);
  };
  try {
    file_->each_row("SELECT " + list + " FROM Admin LIMIT 1", {}, read);
  } catch (const Error& error) {
    throw error.context().file.empty()
        ? Error("Admin." + field + ": " + error.what(), {.file = path_.string()})
        : error;
  }
  return map;
}

}  // namespace libmap

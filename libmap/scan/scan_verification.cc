#include "libmap/scan/scan_verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace {

struct LaserFormat {
  const char* name;
  int channels;
};

// Laser scan formats, by RTAB-Map's numbers.
constexpr std::size_t unknown_format = 0;
constexpr std::array<LaserFormat, 13> laser_formats{{{"unknown", 0},
                                                     {"XY", 2},
                                                     {"XYI", 3},
                                                     {"XYNormal", 5},
                                                     {"XYINormal", 6},
                                                     {"XYZ", 3},
                                                     {"XYZI", 4},
                                                     {"XYZRGB", 4},
                                                     {"XYZNormal", 6},
                                                     {"XYZINormal", 7},
                                                     {"XYZRGBNormal", 7},
                                                     {"XYZIT", 5},
                                                     {"XYZIRT", 6}}};

std::size_t format_of(float number) {
  if (!(number >= 0) || number > 12 || number != std::floor(number))
    throw Error("unknown", {.field = "format of the laser scan", .value = to_text(number)});
  return static_cast<std::size_t>(number);
}

// Checks the column scan_info and returns the scan's format.
std::size_t format_of_info(std::string_view info) {
  if (info.empty()) return unknown_format;
  if (info.size() != 76 && info.size() != 60 && info.size() != 56)
    throw Error("unknown", {.field = "length of scan_info",
                            .value = std::to_string(info.size()) + " bytes",
                            .bound = "56, 60 or 76 bytes"});
  std::vector<float> numbers(info.size() / sizeof(float));
  std::memcpy(numbers.data(), info.data(), info.size());
  const std::size_t format = info.size() == 76   ? format_of(numbers[0])
                             : info.size() == 60 ? format_of(numbers[2])
                                                 : unknown_format;
  const float points = numbers[info.size() == 76 ? 6 : 0];
  if (!(points >= 0 && points <= 2e9F))
    throw Error("out of range", {.field = "number of points in scan_info",
                                 .value = to_text(points),
                                 .bound = ">= 0 and <= 2e9"});
  decode_pose(info.substr(info.size() - pose_bytes));
  return format;
}

}  // namespace

void check_laser_scan(std::string_view scan, std::string_view info) {
  const std::size_t format = format_of_info(info);
  const StoredMatrix matrix = decode_matrix(scan);
  if (matrix.element != MatrixElement::float32)
    throw Error("laser scan does not consist of float32 numbers");
  // Versions before 0.16.1 do not store the format; they used 2 to 7 channels.
  if (format == unknown_format && (matrix.channels < 2 || matrix.channels > 7))
    throw Error("unknown", {.field = "number of channels of the laser scan",
                            .value = std::to_string(matrix.channels)});
  if (format != unknown_format && matrix.channels != laser_formats[format].channels)
    throw Error("wrong for format " + std::string(laser_formats[format].name),
                {.field = "number of channels of the laser scan",
                 .value = std::to_string(matrix.channels),
                 .bound = std::to_string(laser_formats[format].channels)});
}

namespace {

// Memory budget of scans and frames that are decoded in parallel.
constexpr std::uint64_t decoded_bytes = std::uint64_t{1} << 28;

void check_pose(const std::string& blob) { decode_pose(blob); }
void check_velocity(const std::string& blob) { decode_velocity(blob); }
void check_gps(const std::string& blob) { decode_gps(blob); }
void check_information(const std::string& blob) { decode_information(blob); }
void check_matrix(const std::string& blob) {
  for_each_matrix_chunk(blob, [](std::string_view) {});
}
void check_image(const std::string& blob) { decode_color(blob); }

void check_depth(const std::string& blob) {
  if (read_depth_info(blob))
    decode_depth(blob);
  else
    decode_gray(blob);
}

// Checks the length: three float64 per sensor.
void check_sensors(const std::string& blob) {
  if (blob.size() % 24 != 0)
    throw Error("wrong", {.field = "length of env_sensors",
                          .value = std::to_string(blob.size()) + " bytes",
                          .bound = "a multiple of 24 bytes"});
}

struct BlobColumn {
  const char* table;
  const char* node;  // column of the node's id; nullptr if there is none
  const char* column;
  void (*check)(const std::string&);
};

// All blobs, except those of Data and those whose length is in another column.
constexpr std::array<BlobColumn, 21> blob_columns{{
    {"Node", "id", "pose", check_pose},
    {"Node", "id", "ground_truth_pose", check_pose},
    {"Node", "id", "velocity", check_velocity},
    {"Node", "id", "gps", check_gps},
    {"Node", "id", "env_sensors", check_sensors},
    {"Link", "from_id", "transform", check_pose},
    {"Link", "from_id", "information_matrix", check_information},
    {"Link", "from_id", "user_data", check_matrix},
    {"GlobalDescriptor", "node_id", "info", check_matrix},
    {"GlobalDescriptor", "node_id", "data", check_matrix},
    {"Tag", "node_id", "transform", check_pose},
    {"Statistics", "id", "wm_state", check_matrix},
    {"Admin", nullptr, "opt_ids", check_matrix},
    {"Admin", nullptr, "opt_poses", check_matrix},
    {"Admin", nullptr, "opt_last_localization", check_pose},
    {"Admin", nullptr, "opt_map", check_matrix},
    {"Admin", nullptr, "opt_cloud", check_matrix},
    {"Admin", nullptr, "opt_polygons", check_matrix},
    {"Admin", nullptr, "opt_tex_coords", check_matrix},
    {"Admin", nullptr, "opt_tex_materials", check_image},
    {"Admin", nullptr, "preview_image", check_image},
}};

// Thread-safe collection of results.
class Findings {
 public:
  explicit Findings(ScanVerificationResult& result) : result_(result) {}

  void add(int node, std::string part, const Error& error) {
    const std::lock_guard lock(mutex_);
    result_.faults.push_back({node, std::move(part), error.what()});
  }

  void count(const std::string& blob) {
    const std::lock_guard lock(mutex_);
    ++result_.blobs;
    result_.bytes += blob.size();
  }

  // Checks a blob of Data, in which a few bytes mean NULL. Returns true if it is valid.
  template <typename Check>
  bool check(int node, const std::string& part, const std::string& blob, const Check& use) {
    return is_absent(blob) || check_present(node, part, blob, use);
  }
  template <typename Check>
  bool check_present(int node, const std::string& part, const std::string& blob, const Check& use) {
    count(blob);
    return attempt(node, part, [&] { use(blob); });
  }

  template <typename Step>
  bool attempt(int node, const std::string& part, const Step& step) {
    try {
      step();
      return true;
    } catch (const Error& error) {
      add(node, part, error);
      return false;
    }
  }

 private:
  ScanVerificationResult& result_;
  std::mutex mutex_;
};

int node_in(const SqliteRow& row, int column) {
  const std::int64_t id = row.integer(column);
  return id > 0 && id <= 0x7fffffff ? static_cast<int>(id) : 0;
}

std::string part_of(const char* table, const char* column) {
  return std::string(table) + "." + column;
}

// Maximum memory for decoding, by the headers of the blobs; 0 for damaged ones.
std::uint64_t scan_bytes(const std::string& blob) {
  const StoredMatrix size = read_matrix_header(blob);
  return static_cast<std::uint64_t>(size.rows) * static_cast<std::uint64_t>(size.columns) *
         static_cast<std::uint64_t>(size.channels) * bytes_of(size.element);
}

std::uint64_t frame_bytes(const FrameBlobs& blobs) {
  constexpr std::uint64_t pixel_bytes = 16;  // in the frame and in a camera's view
  std::uint64_t pixels = 0;
  const auto add = [&](int width, int height) {
    pixels += static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  };
  try {
    if (const auto color = read_image_info(blobs.image)) add(color->width, color->height);
    if (const auto depth = read_depth_info(blobs.depth)) add(depth->width, depth->height);
  } catch (const Error&) {
  }
  return pixels * pixel_bytes;
}

class DatabaseVerification {
 public:
  DatabaseVerification(const RtabmapDatabase& scan, ScanVerificationResult& result,
                       Progress& progress)
      : scan_(scan), result_(result), findings_(result), progress_(progress) {}

  void run() {
    findings_.attempt(0, "file", [&] { check_structure(); });
    for (const BlobColumn& column : blob_columns)
      findings_.attempt(0, column.table, [&] { check_column(column); });
    findings_.attempt(0, "Statistics.data", [&] { check_statistics(); });
    for (const char* table : {"Word", "Feature", "Map_Node_Word"})
      findings_.attempt(0, table, [&] { check_descriptors(table); });
    findings_.attempt(0, "Admin", [&] { scan_.stored_map(); });
    check_frames();
  }

 private:
  void check_structure() {
    scan_.file().each_row("PRAGMA quick_check(20)", {}, [&](const SqliteRow& row) {
      if (row.bytes(0) != "ok") findings_.add(0, "file", Error(row.bytes(0)));
    });
  }

  void check_column(const BlobColumn& of) {
    if (!scan_.columns().has(of.table, of.column)) return;
    if (of.node != nullptr && !scan_.columns().has(of.table, of.node)) return;
    const std::string node = of.node == nullptr ? "0" : of.node;
    scan_.file().each_row("SELECT " + node + ", " + of.column + " FROM " + of.table, {},
                          [&](const SqliteRow& row) {
                            const std::string blob = row.bytes(1);
                            const std::string part = part_of(of.table, of.column);
                            if (row.is_text(1) && !blob.empty())
                              findings_.add(node_in(row, 0), part, Error("is text, not a blob"));
                            else if (!blob.empty())
                              findings_.check_present(node_in(row, 0), part, blob, of.check);
                          });
  }

  // Statistics were plain text before 0.15.
  void check_statistics() {
    if (!scan_.columns().has("Statistics", "data")) return;
    scan_.file().each_row("SELECT id, data FROM Statistics", {}, [&](const SqliteRow& row) {
      if (row.is_text(1)) return;
      findings_.check(node_in(row, 0), "Statistics.data", row.bytes(1),
                      [](const std::string& blob) { decode_compressed_text(blob); });
    });
  }

  // Descriptors have descriptor_size bytes or float32.
  void check_descriptors(const char* table) {
    const RtabmapColumns& columns = scan_.columns();
    if (!columns.has(table, "descriptor") || !columns.has(table, "descriptor_size")) return;
    const std::string node = columns.has(table, "node_id") ? "node_id" : "0";
    const auto check = [&](const SqliteRow& row) {
      const std::int64_t size = row.integer(1);
      const std::int64_t bytes = row.integer(2);
      if (bytes <= 0) return;
      ++result_.blobs;
      result_.bytes += static_cast<std::uint64_t>(bytes);
      if (size > 0 && (bytes == size || (bytes % 4 == 0 && bytes / 4 == size))) return;
      findings_.add(node_in(row, 0), part_of(table, "descriptor"),
                    Error("does not match descriptor_size",
                          {.field = "length",
                           .value = std::to_string(bytes) + " bytes",
                           .bound = std::to_string(size) + ", or 4 times as many"}));
    };
    scan_.file().each_row("SELECT " + node + ", descriptor_size, length(descriptor) FROM " + table,
                          {}, check);
  }

  void check_frames() {
    const std::string table = scan_.columns().has_table("Data") ? "Data" : "Image";
    if (!scan_.columns().has_table(table)) return;
    std::vector<std::int64_t> ids;
    findings_.attempt(0, table, [&] {
      scan_.file().each_row("SELECT id FROM " + table + " ORDER BY id", {},
                            [&](const SqliteRow& row) { ids.push_back(row.integer(0)); });
    });
    progress_.begin("verify", ids.size());
    parallel_each(ids.size(), [&](std::size_t i) {
      const int node = ids[i] > 0 && ids[i] <= 0x7fffffff ? static_cast<int>(ids[i]) : 0;
      findings_.attempt(node, table, [&] {
        if (table == "Data") check_data(node, ids[i]);
        if (scan_.graph().find_node(node) != nullptr) check_frame(node);
      });
      progress_.advance(1);
    });
    progress_.end();
    result_.nodes = ids.size();
    for (const GraphNode& node : scan_.graph().nodes)
      if (!std::binary_search(ids.begin(), ids.end(), node.id))
        findings_.add(node.id, table, Error("the node has no row"));
  }

  // Checks the blobs of Data that are not part of a frame.
  void check_data(int node, std::int64_t id) {
    static constexpr std::array<const char*, 5> matrices{
        "depth_confidence", "ground_cells", "obstacle_cells", "empty_cells", "user_data"};
    const RtabmapColumns& columns = scan_.columns();
    std::string list =
        columns.or_null("Data", "scan") + ", " + columns.or_null("Data", "scan_info");
    for (const char* column : matrices) list += ", " + columns.or_null("Data", column);
    std::vector<std::string> blobs;
    scan_.file().each_row("SELECT " + list + " FROM Data WHERE id = ?", {id},
                          [&](const SqliteRow& row) {
                            for (int i = 0; i < 7; ++i) blobs.push_back(row.bytes(i));
                          });
    if (blobs.size() < 7) return;
    findings_.check(node, "Data.scan", blobs[0], [&](const std::string& scan) {
      const MemoryBudget::Reservation reservation = memory_.take(scan_bytes(scan));
      check_laser_scan(scan, is_absent(blobs[1]) ? std::string() : blobs[1]);
    });
    for (std::size_t i = 0; i < matrices.size(); ++i)
      findings_.check(node, part_of("Data", matrices[i]), blobs[2 + i], check_matrix);
  }

  void check_frame(int node) {
    const FrameBlobs blobs = scan_.read_blobs(node);
    for (const std::string* blob : {&blobs.image, &blobs.depth, &blobs.calibration})
      if (!blob->empty()) findings_.count(*blob);
    const MemoryBudget::Reservation reservation = memory_.take(frame_bytes(blobs));
    try {
      camera_views(decode_frame(blobs));
    } catch (const Error& error) {
      list_faults(node, blobs, error);
    }
  }

  // Decodes each part separately, so that one fault does not hide another.
  void list_faults(int node, const FrameBlobs& blobs, const Error& first) {
    bool is_listed = false;
    const auto check = [&](const char* part, const std::string& blob, auto use) {
      if (!blob.empty()) is_listed |= !findings_.attempt(node, part, [&] { use(blob); });
    };
    check("Data.image", blobs.image, check_image);
    check("Data.depth", blobs.depth, check_depth);
    check("Data.calibration", blobs.calibration, decode_calibration);
    if (!is_listed) findings_.add(node, "Data", first);
  }

  const RtabmapDatabase& scan_;
  ScanVerificationResult& result_;
  Findings findings_;
  Progress& progress_;
  MemoryBudget memory_{decoded_bytes};
};

void verify_frames(const ScanSource& scan, ScanVerificationResult& result, Progress& progress) {
  Findings findings(result);
  const std::vector<GraphNode>& nodes = scan.graph().nodes;
  progress.begin("verify", nodes.size());
  parallel_each(nodes.size(), [&](std::size_t i) {
    findings.attempt(nodes[i].id, "frame", [&] { camera_views(scan.read_frame(nodes[i].id)); });
    progress.advance(1);
  });
  progress.end();
  result.nodes = nodes.size();
}

}  // namespace

ScanVerificationResult verify_scan(const ScanSource& scan, Progress& progress) {
  ScanVerificationResult result;
  if (const auto* database = dynamic_cast<const RtabmapDatabase*>(&scan))
    DatabaseVerification(*database, result, progress).run();
  else
    verify_frames(scan, result, progress);
  // Adds warnings about data that the graph dropped, unless the fault is listed.
  for (const std::string& warning : scan.warnings()) {
    if (is_about_unknown_part(warning)) continue;
    const bool is_listed =
        std::any_of(result.faults.begin(), result.faults.end(), [&](const ScanFault& fault) {
          return warning.ends_with(fault.reason) ||
                 (fault.node == 0 && warning.starts_with(fault.part + ": "));
        });
    if (!is_listed) result.faults.push_back({0, "graph", warning});
  }
  std::sort(result.faults.begin(), result.faults.end(), [](const auto& a, const auto& b) {
    return std::tie(a.node, a.part, a.reason) < std::tie(b.node, b.part, b.reason);
  });
  return result;
}

}  // namespace libmap

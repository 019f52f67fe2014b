#include "libmap/io/cloud_io.h"

#include <algorithm>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/output_lock.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/io/cloud_columns.h"
#include "libmap/io/pcd_codec.h"
#include "libmap/io/ply_codec.h"
#include "libmap/io/vtp_codec.h"
#include "libmap/raster/dem_reader.h"

namespace libmap {

namespace {

bool is_coordinate(const std::string& name) {
  return name.size() == 1 && std::string("xyzXYZ").find(name) != std::string::npos;
}

bool has_numbers(const Table& table, std::size_t column) {
  return std::any_of(table.rows.begin(), table.rows.end(),
                     [column](const auto& row) { return parse_double(row[column]).has_value(); });
}

// int32 if every value is an integer in its range, else float64.
ScalarType type_of(const std::vector<double>& values) {
  const bool integers = std::all_of(values.begin(), values.end(), [](double value) {
    return fits_type(value, ScalarType::int32) && !(value == 0.0 && std::signbit(value));
  });
  return integers ? ScalarType::int32 : ScalarType::float64;
}

std::vector<double> numbers_of(const Table& table, std::size_t column) {
  const bool required = is_coordinate(table.columns[column]);
  std::vector<double> values(table.rows.size());
  for (std::size_t row = 0; row < values.size(); ++row)
    values[row] =
        required
            ? table.number(row, column)
            : table.optional_number(row, column).value_or(std::numeric_limits<double>::quiet_NaN());
  return values;
}

// Skips columns without any number and lists them in info.skipped. Throws Error for a cell that is
// not a number in a column of numbers, and for an empty cell in x, y or z.
GeometryColumns decode_csv(std::string_view text, const std::string& file) {
  const Table table = parse_csv(text, file);
  GeometryColumns content;
  content.info.format = "csv";
  content.info.encoding = FileEncoding::ascii;
  content.info.bytes = text.size();
  content.info.points = table.rows.size();
  content.vertices.rows = table.rows.size();
  for (std::size_t column = 0; column < table.columns.size(); ++column) {
    const std::string& name = table.columns[column];
    if (!table.rows.empty() && !is_coordinate(name) && !has_numbers(table, column)) {
      content.info.skipped.push_back("column " + name);
      continue;
    }
    const std::vector<double> values = numbers_of(table, column);
    const ScalarType type = is_coordinate(name) ? ScalarType::float64 : type_of(values);
    std::copy(values.begin(), values.end(), content.vertices.add_numbers(name, type));
    content.info.fields.push_back({name, type, 1});
  }
  return content;
}

// A header line and a row per point, each number as the shortest text that parses to it.
void encode_csv(const ColumnSet& columns, std::ostream& out) {
  Table header;
  for (const Column& column : columns.columns) header.columns.push_back(column.name);
  out << to_csv(header);
  write_rows(columns.rows, out, [&](std::size_t begin, std::size_t end, std::string& text) {
    append_rows_of_text(columns.columns, begin, end, ',', text);
  });
}

// Throws Error unless the format can be read (`is_read`) or written.
void require_format(const std::filesystem::path& path, bool is_read) {
  const std::string format = format_of(path);
  std::vector<std::string> formats = {".pcd", ".ply", ".csv"};
  if (is_read)
    formats.insert(formats.end(), {".tif", ".tiff"});
  else
    formats.emplace_back(".vtp");
  if (std::find(formats.begin(), formats.end(), format) != formats.end()) return;
  // Debian 12 has no library for LAS and LAZ.
  if (format == ".las" || format == ".laz")
    throw Error(
        "LAS and LAZ cannot be read or written: Debian has no library for them; convert "
        "to .pcd, .ply or .csv",
        {.file = path.string()});
  throw Error("not a cloud format" + did_you_mean(format, formats),
              {.file = path.string(),
               .field = "extension",
               .value = format.empty() ? "missing" : format,
               .bound = is_read ? ".pcd, .ply, .csv or .tif" : ".pcd, .ply, .csv or .vtp"});
}

// Decodes a memory-mapped file without a copy.
GeometryColumns decode_mapped_pcd(const std::filesystem::path& path) {
  namespace ipc = boost::interprocess;
  if (std::filesystem::file_size(path) == 0) throw Error("is empty");
  try {
    const ipc::file_mapping file(path.c_str(), ipc::read_only);
    const auto region = std::make_shared<ipc::mapped_region>(file, ipc::read_only);
    return decode_pcd({static_cast<const char*>(region->get_address()), region->get_size()},
                      region);
  } catch (const ipc::interprocess_exception& error) {
    throw Error(std::string("cannot be read: ") + error.what());
  }
}

GeometryColumns decode(const std::filesystem::path& path) {
  const std::string format = format_of(path);
  if (format == ".pcd") return decode_mapped_pcd(path);
  const auto bytes = read_geometry_bytes(path);
  if (format == ".ply") return decode_ply(bytes);
  return decode_csv(*bytes, {});
}

GeometryFileInfo dem_file_info(const std::filesystem::path& path) {
  GeometryFileInfo info;
  info.format = "tif";
  info.bytes = std::filesystem::file_size(path);
  info.points = DemReader(path).info().pixels();
  for (const char* const axis : {"x", "y", "z"})
    info.fields.push_back({axis, ScalarType::float64, 1});
  return info;
}

}  // namespace

void require_cloud_format(const std::filesystem::path& path) { require_format(path, false); }

void refuse_vtp(const std::filesystem::path& path) {
  if (format_of(path) == ".vtp")
    throw Error(
        ".vtp is written only, for ParaView; readable formats are .pcd, .ply, .csv or .tif "
        "(clouds) and .ply, .obj, .off, .stl, .glb or .tif (meshes)",
        {.file = path.string()});
}

void require_cloud_file(const std::filesystem::path& path) {
  refuse_vtp(path);
  require_format(path, true);
  require_readable_file(path);
}

std::string format_of(const std::filesystem::path& path) {
  return lower_case(path.extension().string());
}

std::string read_head(const std::filesystem::path& path) {
  return file_head(path, std::min<std::uint64_t>(std::filesystem::file_size(path), 1 << 20));
}

std::shared_ptr<const std::string> read_geometry_bytes(const std::filesystem::path& path) {
  auto bytes = std::make_shared<const std::string>(read_whole_file(path, machine_memory()));
  if (bytes->empty()) throw Error("is empty", {.file = path.string()});
  return bytes;
}

void write_geometry_file(const std::filesystem::path& path,
                         const std::function<void(std::ostream&)>& write) {
  errno = 0;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  const auto require_good = [&] {
    if (!file) throw system_failure(path, "cannot be written", errno);
  };
  require_good();
  in_file(path, [&] { write(file); });
  file.close();
  require_good();
}

std::vector<std::filesystem::path> cloud_tiles(const std::filesystem::path& given) {
  if (!std::filesystem::is_directory(given)) {
    require_cloud_file(given);
    return {given};
  }
  std::vector<std::filesystem::path> tiles;
  for (const std::filesystem::directory_entry& entry : std::filesystem::directory_iterator(given)) {
    const std::string format = format_of(entry.path());
    // A .vtp counts as a cloud, so that opening it fails: without it, the terrain is incomplete.
    const bool is_cloud = format == ".pcd" || format == ".ply" || format == ".vtp" ||
                          format == ".csv" || is_dem_path(entry.path());
    if (is_cloud && entry.is_regular_file() && entry.path().filename().string().front() != '.')
      tiles.push_back(entry.path());
  }
  if (tiles.empty())
    throw Error("the folder contains no cloud (.pcd, .ply, .csv, .tif)", {.file = given.string()});
  std::sort(tiles.begin(), tiles.end());
  for (const std::filesystem::path& tile : tiles)
    if (is_dem_path(tile) != is_dem_path(tiles.front()))
      throw Error("DEMs and clouds have different frames; use separate folders",
                  {.file = tile.string()});
  return tiles;
}

CloudReadResult read_cloud(const std::filesystem::path& path,
                           const std::optional<Georeference>& frame) {
  if (std::filesystem::is_directory(path)) {
    CloudReadResult joined;
    const std::vector<std::filesystem::path> tiles = cloud_tiles(path);
    const auto first_frame =
        !frame && is_dem_path(tiles.front()) ? read_georeference(tiles.front()) : frame;
    for (const std::filesystem::path& tile : tiles) {
      CloudReadResult read = read_cloud(tile, first_frame);
      append_cloud(read.cloud, joined.cloud);
      joined.dropped_points += read.dropped_points;
      joined.info = std::move(read.info);
    }
    return joined;
  }
  require_cloud_file(path);
  if (is_dem_path(path)) {
    CloudReadResult read{{}, 0, dem_file_info(path)};
    read.cloud = read_dem_cloud(path, &read.dropped_points, frame);
    return read;
  }
  return in_file(path, [&] {
    GeometryColumns content = decode(path);
    if (content.info.faces > 0)
      content.info.skipped.push_back(std::to_string(content.info.faces) + " faces");
    CloudFromColumns read = cloud_from_columns(content.vertices, NotFinite::drop);
    if (content.viewpoint) read.cloud.viewpoint = *content.viewpoint;
    return CloudReadResult{std::move(read.cloud), read.dropped_points, std::move(content.info)};
  });
}

GeometryFileInfo read_cloud_info(const std::filesystem::path& path) {
  require_cloud_file(path);
  if (is_dem_path(path)) return dem_file_info(path);
  const std::string format = format_of(path);
  return in_file(path, [&] {
    if (format == ".pcd") return pcd_info(read_head(path), std::filesystem::file_size(path));
    if (format == ".ply") return ply_info(read_head(path), std::filesystem::file_size(path));
    return decode_csv(*read_geometry_bytes(path), {}).info;
  });
}

void write_cloud(const std::filesystem::path& path, const PointCloud& cloud,
                 const GeometryWriteOptions& options) {
  require_cloud_format(path);
  const std::string format = format_of(path);
  const NormalNames names = format == ".pcd" ? NormalNames::long_names : NormalNames::short_names;
  write_geometry_file(path, [&](std::ostream& out) {
    const ColumnSet columns = columns_of_cloud(cloud, names);
    const GeometryContent content{.vertices = &columns, .viewpoint = &cloud.viewpoint};
    if (format == ".pcd")
      encode_pcd(columns, cloud.viewpoint, options.encoding, out);
    else if (format == ".ply")
      encode_ply(content, options, out);
    else if (format == ".vtp")
      encode_vtp(content, options.encoding, out);
    else
      encode_csv(columns, out);
  });
}

PcdPartsWriter::PcdPartsWriter(std::filesystem::path path, const PcdPartsOptions& options)
    : path_(std::move(path)), options_(options), file_(path_, std::ios::binary | std::ios::trunc) {
  require_good();
}

// An ofstream reports a failed open, write or close only by its state; errno is that of the last
// system call.
void PcdPartsWriter::require_good() const {
  if (!file_) throw system_failure(path_, "cannot be written", errno);
}

void PcdPartsWriter::append(const PointCloud& part) {
  if (part.empty()) return;  // an empty part does not determine the attributes of the cloud
  written_ += part.size();
  if (written_ > options_.points)
    throw Error("more than declared", {.file = path_.string(),
                                       .field = "number of points",
                                       .value = std::to_string(written_),
                                       .bound = std::to_string(options_.points)});
  ColumnSet set = columns_of_cloud(part, NormalNames::long_names);
  for (Column& column : set.columns)
    if (column.name == "x" || column.name == "y" || column.name == "z")
      column.type = options_.float64_positions ? ScalarType::float64 : ScalarType::float32;
  const std::string header = pcd_header(set, options_.points, part.viewpoint, FileEncoding::binary);
  if (header_.empty())
    file_ << header;
  else if (header != header_)
    throw Error("the parts have different ones",
                {.file = path_.string(), .field = "fields or viewpoints"});
  header_ = header;
  encode_pcd_points(set, FileEncoding::binary, file_);
  require_good();
}

void PcdPartsWriter::finish() {
  if (written_ != options_.points)
    throw Error("fewer than declared", {.file = path_.string(),
                                        .field = "number of points",
                                        .value = std::to_string(written_),
                                        .bound = std::to_string(options_.points)});
  file_.close();
  require_good();
}

}  // namespace libmap

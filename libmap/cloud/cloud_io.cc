#include "libmap/cloud/cloud_io.h"

#include <algorithm>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_columns.h"
#include "libmap/cloud/csv_codec.h"
#include "libmap/cloud/pcd_codec.h"
#include "libmap/cloud/ply_codec.h"
#include "libmap/cloud/vtp_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/file_size.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

// `is_read`: the formats that clouds are read from, else those that they are written in.
void require_format(const std::filesystem::path& path, bool is_read) {
  const std::string format = format_of(path);
  std::vector<std::string> formats = {".pcd", ".ply", ".csv"};
  if (!is_read) formats.push_back(".vtp");
  if (std::find(formats.begin(), formats.end(), format) != formats.end()) return;
  // No library of Debian 12 reads LAS, and LAZ even less.
  if (format == ".las" || format == ".laz")
    throw Error(
        "LAS and LAZ cannot be read or written: Debian has no library for them; convert "
        "to .pcd, .ply or .csv",
        {.file = path.string()});
  throw Error("not a cloud format" + did_you_mean(format, formats),
              {.file = path.string(),
               .field = "extension",
               .value = format.empty() ? "missing" : format,
               .bound = is_read ? ".pcd, .ply or .csv" : ".pcd, .ply, .csv or .vtp"});
}

// The file's bytes as the system's own cache holds them, without a copy.
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

}  // namespace

void require_cloud_format(const std::filesystem::path& path) { require_format(path, false); }

void refuse_vtp(const std::filesystem::path& path) {
  if (format_of(path) == ".vtp")
    throw Error(
        ".vtp is written only, for ParaView; readable are clouds as .pcd, .ply or .csv and meshes "
        "as .ply, .obj, .off, .stl or .glb",
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
  std::string head(std::min<std::uint64_t>(std::filesystem::file_size(path), 1 << 20), '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return head;
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
    if (!file)
      throw Error(std::string("cannot be written") +
                      (errno == 0 ? "" : std::string(": ") + std::strerror(errno)),
                  {.file = path.string()}, ErrorKind::failed);
  };
  require_good();
  try {
    write(file);
  } catch (const Error& error) {
    throw error.in_file(path.string());
  }
  file.close();
  require_good();
}

CloudReadResult read_cloud(const std::filesystem::path& path) {
  require_cloud_file(path);
  try {
    GeometryColumns content = decode(path);
    if (content.info.faces > 0)
      content.info.skipped.push_back(std::to_string(content.info.faces) + " faces");
    CloudFromColumns read = cloud_from_columns(content.vertices, NotFinite::drop);
    if (content.viewpoint) read.cloud.viewpoint = *content.viewpoint;
    return {std::move(read.cloud), read.dropped_points, std::move(content.info)};
  } catch (const Error& error) {
    throw error.in_file(path.string());
  }
}

GeometryFileInfo read_cloud_info(const std::filesystem::path& path) {
  require_cloud_file(path);
  const std::string format = format_of(path);
  try {
    if (format == ".pcd") return pcd_info(read_head(path), std::filesystem::file_size(path));
    if (format == ".ply") return ply_info(read_head(path), std::filesystem::file_size(path));
    return decode_csv(*read_geometry_bytes(path), {}).info;
  } catch (const Error& error) {
    throw error.in_file(path.string());
  }
}

void write_cloud(const std::filesystem::path& path, const PointCloud& cloud,
                 const CloudWriteOptions& options) {
  require_cloud_format(path);
  const std::string format = format_of(path);
  const NormalNames names = format == ".pcd" ? NormalNames::long_names : NormalNames::short_names;
  write_geometry_file(path, [&](std::ostream& out) {
    const ColumnSet columns = columns_of_cloud(cloud, names);
    if (format == ".pcd")
      encode_pcd(columns, cloud.viewpoint, options.encoding, out);
    else if (format == ".ply")
      encode_ply({.vertices = &columns, .viewpoint = &cloud.viewpoint},
                 {options.encoding == FileEncoding::ascii, options.big_endian}, out);
    else if (format == ".vtp")
      encode_vtp({.vertices = &columns, .viewpoint = &cloud.viewpoint}, options.encoding, out);
    else
      encode_csv(columns, out);
  });
}

}  // namespace libmap

#include "libmap/bag/bag_cloud.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/message_codec.h"
#include "libmap/bag/message_encoding.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/core/error.h"
#include "libmap/io/cloud_columns.h"

namespace libmap {

namespace {

using ros_message::PointCloud2;
using ros_message::PointField;

constexpr std::size_t max_columns = 1024;

constexpr std::pair<std::uint8_t, StoredType> field_types[] = {
    {PointField::INT8, StoredType::int8},       {PointField::UINT8, StoredType::uint8},
    {PointField::INT16, StoredType::int16},     {PointField::UINT16, StoredType::uint16},
    {PointField::INT32, StoredType::int32},     {PointField::UINT32, StoredType::uint32},
    {PointField::FLOAT32, StoredType::float32}, {PointField::FLOAT64, StoredType::float64},
};

StoredType type_of(const PointField& field) {
  for (const auto& [number, type] : field_types)
    if (number == field.datatype) return type;
  throw Error("unknown type of number", {.field = "datatype of field " + field.name,
                                         .value = std::to_string(field.datatype),
                                         .bound = "1 to 8"});
}

// Returns the datatype number of a type in PointField; all types have one.
std::uint8_t number_of(ScalarType type) {
  return std::find_if(std::begin(field_types), std::end(field_types),
                      [&](const auto& known) { return known.second == stored_as(type); })
      ->first;
}

Error does_not_fit(const std::string& field, std::uint64_t value, std::uint64_t least) {
  return Error(
      "too small for the content of the message",
      {.field = field, .value = std::to_string(value), .bound = ">= " + std::to_string(least)});
}

// Throws Error if the data are smaller than the declared sizes.
void check_sizes(const PointCloud2& message) {
  const std::uint64_t row = std::uint64_t{message.width} * message.point_step;
  if (message.width == 0 || message.height == 0) return;
  if (message.point_step == 0) throw does_not_fit("point_step", 0, 12);
  // Some programs set row_step to 0 for a single row.
  if (message.height > 1 && message.row_step < row)
    throw does_not_fit("row_step", message.row_step, row);
  const std::uint64_t needed = std::uint64_t{message.row_step} * (message.height - 1) + row;
  if (message.data.size() < needed) throw does_not_fit("data", message.data.size(), needed);
}

// Returns the points without padding between rows.
std::shared_ptr<const std::string> packed_rows(const PointCloud2& message) {
  auto data = std::make_shared<std::string>();
  if (message.width == 0 || message.height == 0) return data;
  const std::size_t row = std::size_t{message.width} * message.point_step;
  data->reserve(row * message.height);
  for (std::size_t y = 0; y < message.height; ++y)
    data->append(reinterpret_cast<const char*>(message.data.data()) + y * message.row_step, row);
  return data;
}

void add_columns(const PointField& field, const PointCloud2& message, const std::byte* first,
                 ColumnSet& set) {
  const std::string& name = field.name;
  const StoredType type = type_of(field);
  const std::size_t bytes = size_of(type);
  // Old drivers set count to 0.
  const std::size_t count = std::max<std::uint32_t>(field.count, 1);
  const bool swapped = message.is_bigendian != (std::endian::native == std::endian::big);
  if (message.point_step < std::uint64_t{field.offset} + bytes * count)
    throw does_not_fit("point_step for field " + name, message.point_step,
                       std::uint64_t{field.offset} + bytes * count);
  if ((name == "rgb" || name == "rgba") && bytes == 4 && count == 1 && !set.find("red"))
    return add_packed_color_columns(first + field.offset, message.point_step, message.is_bigendian,
                                    set);
  if (count > max_columns || set.columns.size() + count > max_columns)
    throw Error("increases a point to more than 1024 numbers", {.field = "field " + name});
  for (std::size_t n = 0; n < count; ++n)
    set.columns.push_back({count == 1 ? name : name + "_" + std::to_string(n), scalar_type_of(type),
                           type, first + field.offset + n * bytes, message.point_step, swapped});
}

}  // namespace

CloudMessage decode_cloud(MessageEncoding encoding, std::string_view bytes) {
  const auto message = ros_message::decode<PointCloud2>(encoding, bytes);
  check_sizes(message);
  const std::shared_ptr<const std::string> data = packed_rows(message);
  ColumnSet set;
  set.rows = std::size_t{message.width} * message.height;
  set.storage.push_back(data);
  for (const PointField& field : message.point_fields)
    add_columns(field, message, reinterpret_cast<const std::byte*>(data->data()), set);
  CloudFromColumns columns = cloud_from_columns(set, NotFinite::drop);
  return {message.header.stamp.nanoseconds, message.header.frame_id, std::move(columns.cloud),
          columns.dropped_points};
}

PointCloud2 encode_cloud(const PointCloud& cloud) {
  ColumnSet set = with_packed_color(columns_of_cloud(cloud, NormalNames::long_names));
  PointCloud2 message;
  std::size_t offset = 0;
  std::size_t color_offset = 0;
  bool has_color = false;
  for (Column& column : set.columns) {
    // RViz supports no other type of positions.
    if (column.name == "x" || column.name == "y" || column.name == "z")
      column.type = ScalarType::float32;
    PointField field;
    const bool is_color = column.name == "rgb";
    if (is_color) color_offset = offset;
    has_color = has_color || is_color;
    field.name = column.name;
    field.offset = static_cast<std::uint32_t>(offset);
    field.datatype = is_color ? std::uint8_t{PointField::FLOAT32} : number_of(column.type);
    field.count = 1;
    message.point_fields.push_back(field);
    offset += size_of(stored_as(column.type));
  }
  constexpr std::uint64_t most = 0xFFFF0000;
  if (set.rows > most / std::max<std::size_t>(offset, 1))
    throw Error("too many for a ROS message, which can contain at most 4 GiB",
                {.field = "number of points", .value = std::to_string(set.rows)});
  std::string records;
  append_records(set.columns, 0, set.rows, false, records);
  // With PCL's alpha of 255, colors are NaN as float32, and Python's readers skip such points.
  if (has_color)
    for (std::size_t row = 0; row < set.rows; ++row) records[row * offset + color_offset + 3] = 0;
  message.data.assign(records.begin(), records.end());
  message.height = 1;
  message.width = static_cast<std::uint32_t>(set.rows);
  message.point_step = static_cast<std::uint32_t>(offset);
  message.row_step = static_cast<std::uint32_t>(set.rows * offset);
  message.is_dense = true;
  return message;
}

namespace {

using ros_message::PointCloud2;

std::string only_cloud_topic(const BagListing& listing) {
  std::string names;
  std::size_t count = 0;
  for (const BagTopic& topic : listing.topics) {
    if (!topic.is(PointCloud2::type)) continue;
    names += (count++ == 0 ? "" : ", ") + topic.name;
  }
  if (count == 1) return names;
  throw Error(count == 0 ? "no topic contains clouds" : "several topics contain clouds",
              {.field = std::string("topics of ") + PointCloud2::type.name,
               .value = count == 0 ? "none" : names,
               .bound = count == 0 ? "" : "a single topic; select one by name"});
}

BagCloudResult read(const std::filesystem::path& bag, const std::string& wanted,
                    const std::optional<double>& stamp_s) {
  const BagListing listing = list_bag(bag);
  const std::string name = wanted.empty() ? only_cloud_topic(listing) : wanted;
  require_topic(listing, name, PointCloud2::type);
  BagCloudResult best;
  std::size_t messages = 0;
  read_bag(bag, {{name}}, [&](const BagMessage& message) {
    CloudMessage cloud = decode_cloud(message.topic.encoding, message.bytes);
    const std::int64_t stamp_ns = cloud.stamp_ns == 0 ? message.recorded_ns : cloud.stamp_ns;
    const double stamp = ros_message::seconds_of(stamp_ns);
    const bool better =
        messages++ == 0 || (stamp_s ? std::abs(stamp - *stamp_s) < std::abs(best.stamp_s - *stamp_s)
                                    : cloud.cloud.size() > best.cloud.size());
    if (better) best = {name, cloud.frame, stamp, std::move(cloud.cloud), cloud.dropped_points, 0};
  });
  best.messages = messages;
  return best;
}

}  // namespace

BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic,
                              const std::optional<double>& stamp_s) {
  return in_file(bag, [&] { return read(bag, topic, stamp_s); });
}

}  // namespace libmap

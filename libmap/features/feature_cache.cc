#include "libmap/features/feature_cache.h"

#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/json_input.h"
#include "libmap/core/manifest.h"
#include "libmap/core/parameters.h"

namespace libmap {

namespace {

using Json = nlohmann::json;

// Increased by each change of the features or of the file format.
constexpr const char* format_version = "graspmap features 3";
constexpr std::size_t digest_digits = 64;
constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 28;

template <typename T>
void append(std::string& bytes, const T* values, std::size_t count) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

template <typename T>
void append(std::string& bytes, const T& value) {
  append(bytes, &value, 1);
}

void append(std::string& bytes, const Camera& camera) {
  for (const int size : {camera.width, camera.height, static_cast<int>(camera.distortion_model)})
    append(bytes, size);
  for (const double number : {camera.fx, camera.fy, camera.cx, camera.cy}) append(bytes, number);
  append(bytes, camera.distortion.size());
  append(bytes, camera.distortion.data(), camera.distortion.size());
  append(bytes, camera.base_from_camera.matrix().data(), 16);
}

template <typename T>
Json binary(const std::vector<T>& values) {
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return Json::binary(std::move(bytes));
}

template <typename T>
std::vector<T> values_of(const Json& json) {
  const std::vector<std::uint8_t>& bytes = json.get_binary();
  if (bytes.size() % sizeof(T) != 0)
    throw Error("number of bytes is not a multiple of the number type's size");
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

std::string encode(const FrameFeatures& frame) {
  std::vector<float> numbers;
  std::vector<std::uint16_t> cameras;
  for (const Feature& feature : frame.features) {
    numbers.insert(numbers.end(), {feature.ray.x(), feature.ray.y(), feature.depth_m,
                                   feature.depth_noise_m, feature.pixel_noise_px});
    cameras.push_back(feature.camera);
  }
  Json surfaces = Json::array();
  for (const DepthSurface& surface : frame.surfaces)
    surfaces.push_back({{"step_px", surface.step_px()}, {"cells", binary(surface.cells())}});
  std::string bytes;
  Json::to_cbor({{"version", format_version},
                 {"without_depth", frame.without_depth},
                 {"numbers", binary(numbers)},
                 {"cameras", binary(cameras)},
                 {"descriptors", binary(frame.descriptors)},
                 {"surfaces", surfaces}},
                bytes);
  return bytes;
}

// Limits the nesting of CBOR to that of this format, because nlohmann's parser is recursive.
class DepthCheck : public Json::json_sax_t {
 public:
  static bool passes(std::string_view bytes) {
    DepthCheck check;
    return Json::sax_parse(bytes, &check, Json::input_format_t::cbor);
  }

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool key(string_t&) override { return true; }
  bool start_object(std::size_t) override { return ++depth_ <= max_depth; }
  bool end_object() override { return --depth_ >= 0; }
  bool start_array(std::size_t) override { return ++depth_ <= max_depth; }
  bool end_array() override { return --depth_ >= 0; }
  bool parse_error(std::size_t, const std::string&, const Json::exception&) override {
    return false;
  }

 private:
  static constexpr int max_depth = 4;
  int depth_ = 0;
};

FrameFeatures decode(std::string_view bytes, FeatureType type,
                     const std::vector<Camera>& depth_cameras) {
  if (!DepthCheck::passes(bytes)) throw Error("is not CBOR, or is nested too deeply");
  const Json json = Json::from_cbor(bytes);
  if (json.at("version") != format_version) throw Error("unknown format version");
  FrameFeatures frame;
  frame.without_depth = integer_at<std::size_t>(json, "without_depth");
  const auto numbers = values_of<float>(json.at("numbers"));
  for (const std::uint16_t camera : values_of<std::uint16_t>(json.at("cameras"))) {
    const std::size_t first = 5 * frame.features.size();
    if (first + 5 > numbers.size() || camera >= depth_cameras.size())
      throw Error("features are truncated");
    frame.features.push_back({{numbers[first], numbers[first + 1]},
                              numbers[first + 2],
                              numbers[first + 3],
                              numbers[first + 4],
                              camera});
  }
  frame.descriptors = values_of<std::uint8_t>(json.at("descriptors"));
  if (numbers.size() != 5 * frame.features.size() ||
      frame.descriptors.size() != descriptor_bytes(type) * frame.features.size())
    throw Error("features are truncated");
  if (json.at("surfaces").size() != depth_cameras.size()) throw Error("surfaces are truncated");
  for (const Json& surface : json.at("surfaces"))
    frame.surfaces.emplace_back(depth_cameras[frame.surfaces.size()],
                                integer_at<int>(surface, "step_px"),
                                values_of<DepthSurface::Cell>(surface.at("cells")));
  return frame;
}

}  // namespace

std::string feature_key(const RgbdFrame& frame, const FeatureOptions& options) {
  std::string bytes = format_version;
  FeatureOptions copy = options;
  ParameterTable table;
  bind(table, copy);
  for (const auto& [key, value] : table.values())
    bytes.append("\n").append(key).append("=").append(value);
  for (const double number : {options.planes.min_pair_fraction, options.planes.max_incidence_deg})
    append(bytes, number);
  append(bytes, options.planes.radius_px);
  for (const Camera& camera : frame.cameras) append(bytes, camera);
  append(bytes, frame.color.width);
  append(bytes, frame.color.pixels.data(), frame.color.pixels.size());
  append(bytes, frame.depth.width);
  append(bytes, frame.depth.pixels.data(), frame.depth.pixels.size());
  return sha256_of(bytes);
}

std::filesystem::path FeatureCache::path_of(const std::string& key) const {
  return folder_ / (key + ".features");
}

bool FeatureCache::read(const std::string& key, const std::vector<Camera>& depth_cameras,
                        FrameFeatures& frame) const {
  if (!enabled() || !std::filesystem::is_regular_file(path_of(key))) return false;
  try {
    const std::string text = read_whole_file(path_of(key), max_file_bytes);
    if (text.size() <= digest_digits || text[digest_digits] != '\n') return false;
    const std::string_view body = std::string_view(text).substr(digest_digits + 1);
    if (sha256_of(body) != std::string_view(text).substr(0, digest_digits)) return false;
    FrameFeatures read = decode(body, frame.type, depth_cameras);
    frame.features = std::move(read.features);
    frame.descriptors = std::move(read.descriptors);
    frame.surfaces = std::move(read.surfaces);
    frame.without_depth = read.without_depth;
    return true;
  } catch (const Error&) {
    return false;
  } catch (const Json::exception&) {
    return false;
  }
}

std::shared_ptr<TempFile> FeatureCache::temp_file() const {
  if (!enabled()) return nullptr;
  try {
    std::error_code failure;
    std::filesystem::create_directory(folder_, failure);
    return std::make_shared<TempFile>(folder_);
  } catch (const Error&) {
    return nullptr;
  }
}

bool FeatureCache::write(const std::string& key, const FrameFeatures& frame) const {
  if (!enabled()) return false;
  try {
    std::error_code failure;
    std::filesystem::create_directory(folder_, failure);
    const std::string body = encode(frame);
    write_whole_file(path_of(key), sha256_of(body) + "\n" + body);
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace libmap

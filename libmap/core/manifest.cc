#include "libmap/core/manifest.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/json_input.h"
#include "libmap/core/pose_graph.h"

namespace libmap {

namespace {

using Json = nlohmann::ordered_json;

// Maximum Frobenius distance between a stored rotation matrix and the nearest rotation.
constexpr double max_rotation_error = 1e-3;

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1)
      throw Error("SHA-256 is not available", {}, ErrorKind::failed);
  }
  void update(const char* bytes, std::size_t count) {
    EVP_DigestUpdate(context_.get(), bytes, count);
  }
  std::string hexadecimal() {
    std::array<unsigned char, 32> digest{};
    EVP_DigestFinal_ex(context_.get(), digest.data(), nullptr);
    std::string text;
    for (const unsigned byte : digest) {
      text += "0123456789abcdef"[byte >> 4U];
      text += "0123456789abcdef"[byte & 15U];
    }
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

Json to_json_value(const ManifestValue& value) {
  return std::visit([](const auto& held) { return Json(held); }, value);
}

// JSON has no NaN and no infinity: they are written as null.
double from_json_number(const Json& json) {
  return json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>();
}

ManifestValue from_json_value(const Json& json) {
  if (json.is_boolean()) return json.get<bool>();
  // A comparison as Json would convert to a signed number first.
  const bool is_large =
      json.is_number_unsigned() && !std::in_range<std::int64_t>(json.get<std::uint64_t>());
  if (json.is_number_integer() && !is_large) return json.get<std::int64_t>();
  if (json.is_number() || json.is_null()) return from_json_number(json);
  if (json.is_array()) {
    std::vector<double> numbers;
    for (const Json& number : json) numbers.push_back(from_json_number(number));
    return numbers;
  }
  return json.get<std::string>();
}

Json to_json_object(const std::vector<std::pair<std::string, ManifestValue>>& values) {
  Json object = Json::object();
  for (const auto& [name, value] : values) object[name] = to_json_value(value);
  return object;
}

std::vector<std::pair<std::string, ManifestValue>> from_json_object(const Json& object) {
  std::vector<std::pair<std::string, ManifestValue>> values;
  for (const auto& [name, value] : object.items())
    values.emplace_back(name, from_json_value(value));
  return values;
}

// Row-major 3 x 4 [R|t].
std::vector<double> to_numbers(const Pose& pose) {
  std::vector<double> numbers;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) numbers.push_back(pose.matrix()(row, column));
  return numbers;
}

Pose from_numbers(const std::vector<double>& numbers) {
  if (numbers.size() != 12)
    throw Error("a transform must have 12 numbers (3 x 4, by rows)",
                {.field = "transforms", .value = std::to_string(numbers.size()) + " numbers long"});
  Pose pose = Pose::Identity();
  std::size_t n = 0;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) pose.matrix()(row, column) = numbers[n++];
  const double error = (nearest_rotation(pose.linear()) - pose.linear()).norm();
  if (!(error <= max_rotation_error) ||
      !(pose.translation().cwiseAbs().maxCoeff() <= max_position_m))
    throw Error("not a rotation with a translation within 1e8 m", {.field = "transforms"});
  return pose;
}

Json to_json_object(const Georeference& georeference) {
  const Eigen::Vector3d& origin = georeference.origin_m;
  return {{"crs_wkt", georeference.crs_wkt},
          {"unit_m", georeference.unit_m},
          {"origin_m", {origin.x(), origin.y(), origin.z()}}};
}

Georeference georeference_from(const Json& json) {
  Georeference georeference;
  georeference.crs_wkt = json.at("crs_wkt").get<std::string>();
  georeference.unit_m = json.at("unit_m").get<double>();
  const auto origin = json.at("origin_m").get<std::vector<double>>();
  if (origin.size() != 3 || !(georeference.unit_m > 0.0))
    throw Error("origin_m must have 3 numbers and unit_m must be > 0", {.field = "georeference"});
  georeference.origin_m = Eigen::Vector3d(origin.data());
  if (!(georeference.origin_m.cwiseAbs().maxCoeff() <= max_position_m))
    throw Error("a coordinate is not finite or too large",
                {.field = "georeference.origin_m", .bound = "-1e8 to 1e8 m"});
  return georeference;
}

template <typename Pairs>
auto find_in(const Pairs& pairs, std::string_view name) -> decltype(&pairs.front().second) {
  for (const auto& [key, value] : pairs)
    if (key == name) return &value;
  return nullptr;
}

}  // namespace

void Manifest::add_parameters(const ParameterTable& table) {
  for (const auto& [key, text] : table.values()) {
    const Parameter* parameter = table.find(key);
    const ParameterType type = parameter == nullptr ? ParameterType::text : parameter->type;
    ManifestValue value = text;
    if (type == ParameterType::boolean) value = parse_bool(text).value_or(false);
    if (type == ParameterType::integer) value = parse_integer(text).value_or(0);
    if (const auto number = parse_double(text); type == ParameterType::real && number)
      value = *number;
    const auto known = std::find_if(parameters.begin(), parameters.end(),
                                    [&key = key](const auto& one) { return one.first == key; });
    if (known == parameters.end())
      parameters.emplace_back(key, value);
    else
      known->second = value;
  }
}

void Manifest::add_results(const ResultTable& table) {
  for (const NamedResult& result : table.results())
    if (result.value) results.emplace_back(result.key, *result.value);
}

void Manifest::add_input(const std::filesystem::path& path) {
  inputs.push_back({path.string(), sha256_of_file(path), std::filesystem::file_size(path)});
}

const ManifestValue* Manifest::find_parameter(std::string_view name) const {
  return find_in(parameters, name);
}
std::optional<double> number_of(const ManifestValue* value) {
  if (value == nullptr) return std::nullopt;
  if (const auto* real = std::get_if<double>(value)) return *real;
  if (const auto* whole = std::get_if<std::int64_t>(value)) return static_cast<double>(*whole);
  return std::nullopt;
}

const ManifestValue* Manifest::find_result(std::string_view name) const {
  return find_in(results, name);
}
const Pose* Manifest::find_transform(std::string_view name) const {
  return find_in(transforms, name);
}

std::filesystem::path manifest_path(const std::filesystem::path& output) {
  return output.string() + ".json";
}

std::string to_json(const Manifest& manifest) {
  Json json;
  json["made_by"] = "graspmap";
  json["version"] = manifest.version;
  json["command"] = manifest.command;
  json["parameters"] = to_json_object(manifest.parameters);
  json["inputs"] = Json::array();
  for (const ManifestInput& input : manifest.inputs)
    json["inputs"].push_back(
        {{"path", input.path}, {"sha256", input.sha256}, {"bytes", input.bytes}});
  json["units"] = {{"length", "m"}, {"angle", "deg"}};
  json["frame"] = manifest.frame;
  json["transforms"] = Json::object();
  for (const auto& [name, pose] : manifest.transforms) json["transforms"][name] = to_numbers(pose);
  if (manifest.georeference) json["georeference"] = to_json_object(*manifest.georeference);
  json["results"] = to_json_object(manifest.results);
  Json timings = Json::object();
  for (const auto& [name, seconds] : manifest.timings_s) timings[name] = seconds;
  json["run"] = {{"threads", manifest.threads}, {"timings_s", timings}};
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::optional<Manifest> read_manifest_of(const std::filesystem::path& output) {
  const std::filesystem::path path = manifest_path(output);
  if (!std::filesystem::exists(path)) return std::nullopt;
  return parse_manifest(read_whole_file(path, std::uint64_t{1} << 26), path.string());
}

Manifest parse_manifest(const std::string& text, const std::string& file) {
  try {
    const auto json = parse_json<Json>(text);
    Manifest manifest;
    manifest.version = json.at("version").get<std::string>();
    manifest.command = json.at("command").get<std::string>();
    manifest.parameters = from_json_object(json.at("parameters"));
    for (const Json& input : json.at("inputs"))
      manifest.inputs.push_back({input.at("path").get<std::string>(),
                                 input.at("sha256").get<std::string>(),
                                 integer_at<std::uint64_t>(input, "bytes")});
    manifest.frame = json.at("frame").get<std::string>();
    for (const auto& [name, numbers] : json.at("transforms").items())
      manifest.transforms.emplace_back(name, from_numbers(numbers.get<std::vector<double>>()));
    if (json.contains("georeference"))
      manifest.georeference = georeference_from(json.at("georeference"));
    manifest.results = from_json_object(json.at("results"));
    if (json.contains("run")) {
      const Json& run = json.at("run");
      manifest.threads = integer_at<unsigned>(run, "threads");
      for (const auto& [name, seconds] : run.at("timings_s").items())
        manifest.timings_s.emplace_back(name, seconds.get<double>());
    }
    return manifest;
  } catch (const nlohmann::json::exception& error) {
    // "[json.exception.KIND.NUMBER] REASON"
    const std::string reason = error.what();
    throw Error("not a manifest of this toolkit: " + reason.substr(reason.find("] ") + 2),
                {.file = file});
  } catch (const Error& error) {
    throw error.in_file(file);
  }
}

std::string sha256_of_file(const std::filesystem::path& path) {
  require_readable_file(path);
  std::ifstream file(path, std::ios::binary);
  Sha256 hash;
  std::vector<char> buffer(std::size_t{1} << 16);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hash.update(buffer.data(), static_cast<std::size_t>(file.gcount()));
  }
  return hash.hexadecimal();
}

std::string sha256_of(std::string_view bytes) {
  Sha256 hash;
  hash.update(bytes.data(), bytes.size());
  return hash.hexadecimal();
}

}  // namespace libmap

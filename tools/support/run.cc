#include "tools/support/run.h"

#include <spdlog/spdlog.h>

#include <cstddef>
#include <cstdint>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>

#include "libmap/core/data_folder.h"
#include "libmap/core/file_output.h"
#include "tools/support/results.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

std::optional<libmap::Manifest> own_manifest_of(const fs::path& output) {
  try {
    return libmap::read_manifest_of(output);
  } catch (const libmap::Error&) {
    return std::nullopt;
  }
}

bool written_by_this_toolkit(const fs::path& output) { return own_manifest_of(output).has_value(); }

// Throws Error if a file that is no manifest of this toolkit has the manifest's path.
void require_no_foreign_manifest(const fs::path& output) {
  const fs::path manifest = libmap::manifest_path(output);
  if (fs::exists(manifest) && !written_by_this_toolkit(output))
    throw libmap::Error("exists and is not a manifest of graspmap; use --force to overwrite it",
                        {.file = manifest.string()});
}

void require_other_than_inputs(const fs::path& output, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs)
    if (fs::exists(output) && fs::exists(input) && fs::equivalent(output, input))
      throw libmap::Error("is the input; choose another output name", {.file = output.string()});
}

void write_named(const libmap::OutputFile& output, const Run::Writer& writer) {
  libmap::write_named(output.temporary_path(), output.final_path(), writer);
}

// Returns true if the folder contains files other than leftovers of killed runs.
bool holds_outputs(const fs::path& folder) {
  const fs::directory_iterator entries(folder);
  return std::any_of(begin(entries), end(entries), [](const fs::directory_entry& entry) {
    return !libmap::is_named_unfinished(entry.path());
  });
}

constexpr std::size_t max_message_bytes = 1000;

bool is_continuation(char c) { return (static_cast<std::uint8_t>(c) & 0xC0) == 0x80; }

// Number of bytes of the first character of `text` if it is printable UTF-8 (RFC 3629), else 0.
std::size_t character_bytes(std::string_view text) {
  const auto first = static_cast<std::uint8_t>(text[0]);
  if (first < 0x80) return first >= 0x20 && first != 0x7F ? 1 : 0;
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < bytes) return 0;
  std::uint32_t code = first & (0xFFU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if (!is_continuation(text[i])) return 0;
    code = code << 6 | (static_cast<std::uint8_t>(text[i]) & 0x3FU);
  }
  const bool is_overlong = bytes > 2 && code < (bytes == 3 ? 0x800U : 0x10000U);
  const bool is_surrogate = code >= 0xD800 && code <= 0xDFFF;
  const bool is_control = code < 0xA0;
  return is_overlong || is_surrogate || is_control || code > 0x10FFFF ? 0 : bytes;
}

std::string printable(std::string_view text) {
  std::string line;
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    if (bytes > 0)
      line += text.substr(0, bytes);
    else if (text[0] == '\n')
      line += ' ';
    else
      line += fmt::format("\\x{:02x}", static_cast<std::uint8_t>(text[0]));
    text.remove_prefix(bytes > 0 ? bytes : 1);
  }
  return line;
}

void make_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code)
    throw libmap::Error("cannot be created: " + code.message(), {.file = folder.string()},
                        libmap::ErrorKind::failed);
}

}  // namespace

std::string sanitize_text(const std::string& text) {
  if (text.size() <= max_message_bytes) return printable(text);
  std::size_t head = max_message_bytes / 2;
  std::size_t tail = text.size() - max_message_bytes / 2;
  while (head > 0 && is_continuation(text[head])) --head;
  while (tail < text.size() && is_continuation(text[tail])) ++tail;
  return printable(std::string_view(text).substr(0, head)) + " ... " +
         printable(std::string_view(text).substr(tail));
}

std::string without_trailing_slash(std::string path) {
  while (path.size() > 1 && path.back() == '/') path.pop_back();
  return path;
}

nlohmann::ordered_json to_json(const libmap::ManifestValue& value) {
  return std::visit([](const auto& held) { return nlohmann::ordered_json(held); }, value);
}

nlohmann::ordered_json to_json(const libmap::ResultTable& table) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const libmap::NamedResult& result : table.results())
    json[result.key] = result.value ? to_json(*result.value) : nlohmann::ordered_json();
  return json;
}

void print_json(const nlohmann::ordered_json& json) {
  std::cout << json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n";
}

Run::Run(std::string command, RunOptions options, libmap::Progress& progress)
    : command_(std::move(command)), options_(options), progress_(progress) {
  manifest_.command = command_;
  manifest_.version = GRASPMAP_VERSION;
  manifest_.threads = options_.threads;
}

void Run::add_input(const fs::path& path) {
  if (fs::is_directory(path)) {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(path))
      if (entry.is_regular_file() && entry.path().filename().string().front() != '.')
        files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) add_input(file);
    return;
  }
  manifest_.add_input(path);
  const fs::path folder_path = path.lexically_relative(libmap::data_folder());
  if (!folder_path.empty() && *folder_path.begin() != "..")
    manifest_.inputs.back().path = folder_path.string();
}

void Run::info(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) spdlog::info("{}", sanitize_text(line));
}
void Run::warn(const std::string& text) { spdlog::warn("{}", sanitize_text(text)); }
void Run::detail(const std::string& text) { spdlog::debug("{}", sanitize_text(text)); }

void Run::add_timings(const std::vector<std::pair<std::string, double>>& timings_s,
                      const std::string& stage) {
  for (const auto& [step, seconds] : timings_s) {
    manifest_.timings_s.emplace_back(stage.empty() ? step : stage + ": " + step, seconds);
    detail(fmt::format("{}: {:.3f} s", manifest_.timings_s.back().first, seconds));
  }
}

Run::Timing::~Timing() {
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  run.add_timings({{name, taken.count()}});
}

void Run::claim_output(const fs::path& path, const std::vector<std::string>& inputs) {
  require_other_than_inputs(path, inputs);
  if (fs::is_directory(path))
    throw libmap::Error("is a folder, not a file", {.file = path.string()});
  if (fs::exists(path) && !options_.force && !written_by_this_toolkit(path))
    throw libmap::Error("exists and was not written by graspmap; use --force to overwrite it",
                        {.file = path.string()});
  if (!options_.force) require_no_foreign_manifest(path);
  // Reports a missing or read-only folder before the work.
  const libmap::OutputFile probe(path);
  claim_manifest(path);
}

void Run::claim_manifest(const fs::path& output) {
  if (claimed_manifests_.contains(output.string())) return;
  try {
    claimed_manifests_.try_emplace(output.string(), libmap::manifest_path(output));
  } catch (const libmap::Error& error) {
    if (error.kind() != libmap::ErrorKind::failed) throw;
    throw libmap::naming(error, output);
  }
}

libmap::OutputFile Run::begin_manifest(const fs::path& output) {
  claim_manifest(output);
  return std::move(claimed_manifests_.extract(output.string()).mapped());
}

void Run::write_together(const fs::path& output, const Files& files, bool is_timed) {
  // The manifest comes first, because outputs without one are not recognized. `make` decides by the
  // output, which is the former one until it is replaced.
  std::vector<libmap::OutputFile> outputs;
  outputs.push_back(begin_manifest(output));
  const auto write = [&] {
    for (const auto& [file, writer] : files) {
      outputs.emplace_back(file);
      write_named(outputs.back(), writer);
    }
  };
  is_timed ? timed("write", write) : write();
  write_named(outputs.front(), text_writer(libmap::to_json(manifest_)));
  libmap::commit_together(outputs);
}

Run::Writer Run::text_writer(std::string text) {
  return
      [text = std::move(text)](const fs::path& temporary) { libmap::write_text(temporary, text); };
}

void Run::write_output(const fs::path& path, const Writer& writer) {
  write_outputs(path, {{path, writer}});
}

void Run::write_text(const fs::path& path, const std::string& text) {
  write_output(path, text_writer(text));
}

void Run::require_own_companions(const fs::path& path, const std::vector<fs::path>& others) {
  const auto earlier = own_manifest_of(path);
  if (options_.force || (earlier && earlier->command == command_)) return;
  for (const fs::path& file : others)
    if (file != path && fs::exists(file))
      throw libmap::Error(
          "exists and was not written with " + path.string() + "; use --force to overwrite it",
          {.file = file.string()});
}

void Run::write_outputs(const fs::path& path, const Files& files) {
  if (options_.dry_run) return;
  std::vector<fs::path> paths;
  for (const auto& [file, writer] : files) paths.push_back(file);
  require_own_companions(path, paths);
  write_together(path, files, true);
}

void Run::claim_output_folder(const fs::path& given) {
  require_own_folder(given, "; use --force to write into it");
  const fs::path folder = without_trailing_slash(given.string());
  const fs::path folder_path = folder.has_parent_path() ? folder.parent_path() : ".";
  if (options_.dry_run && !fs::exists(folder_path)) return;
  make_folder(folder_path);
  claim_manifest(folder);
}

void Run::require_own_folder(const fs::path& given, const std::string& remedy) {
  const fs::path folder = without_trailing_slash(given.string());
  if (fs::exists(folder) && !fs::is_directory(folder))
    throw libmap::Error("is a file, not a folder", {.file = folder.string()});
  if (fs::exists(folder) && holds_outputs(folder) && !options_.force) {
    const auto manifest = own_manifest_of(folder);
    if (!manifest)
      throw libmap::Error("is not empty and was not written by graspmap" + remedy,
                          {.file = folder.string()});
    if (manifest->command != command_)
      throw libmap::Error("contains outputs of graspmap " + manifest->command + remedy,
                          {.file = folder.string()});
  }
  if (!options_.force) require_no_foreign_manifest(folder);
}

void Run::write_output_folder(const fs::path& given, const Files& files) {
  if (options_.dry_run) return;
  const fs::path folder = without_trailing_slash(given.string());
  const bool is_new = !fs::exists(folder);
  make_folder(folder);
  try {
    Files inside;
    for (const auto& [name, writer] : files) inside.emplace_back(folder / name, writer);
    write_together(folder, inside, false);
  } catch (...) {
    std::error_code ignored;
    if (is_new) fs::remove(folder, ignored);
    throw;
  }
}

void Run::check_output_tree(const fs::path& given, const std::vector<std::string>& inputs) {
  require_other_than_inputs(given, inputs);
  require_own_folder(given, "");
}

void Run::claim_output_tree(const fs::path& given, const std::vector<std::string>& names,
                            const std::vector<std::string>& inputs) {
  check_output_tree(given, inputs);
  // Reports a folder that cannot be written or replaced before the work.
  const libmap::OutputFolder probe(given, names);
  claim_manifest(without_trailing_slash(given.string()));
}

void Run::write_output_tree(const fs::path& given, const std::vector<std::string>& names,
                            const Writer& writer) {
  if (options_.dry_run) return writer({});
  const fs::path folder = without_trailing_slash(given.string());
  libmap::OutputFile manifest = begin_manifest(folder);
  libmap::OutputFolder output(folder, names);
  timed("write", [&] { libmap::write_named(output.temporary_path(), folder, writer); });
  write_named(manifest, text_writer(libmap::to_json(manifest_)));
  const libmap::CommitGuard guard;
  manifest.commit();
  output.commit();
}

}  // namespace graspmap_tools

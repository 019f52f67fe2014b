#include "libmap/report/report_reader.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/json_input.h"
#include "libmap/core/text.h"
#include "libmap/report/picture_fit.h"
#include "libmap/report/run_folder.h"
#include "libmap/report/table_reader.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view data_variable = "$GRASPMAP_DATA/";
constexpr std::uint64_t max_picture_bytes = std::uint64_t{64} << 20;
constexpr std::uint64_t max_json_bytes = std::uint64_t{64} << 20;

bool is_there(const fs::path& path) {
  std::error_code code;
  return fs::exists(path, code);
}

// Folders' outputs too: "evaluation/" has its manifest beside it.
fs::path without_trailing_slash(const fs::path& path) {
  return path.has_filename() ? path : path.parent_path();
}

std::string text_of(const nlohmann::ordered_json& json) {
  if (json.is_string()) return json.get<std::string>();
  if (json.is_number_float()) return to_text(json.get<double>());
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// The file's next line, cut behind `most` letters: what is no text may have no end of a line.
bool next_line(std::istream& stream, std::size_t most, std::string& line) {
  line.clear();
  bool any = false;
  std::array<char, 4096> part{};
  for (;;) {
    stream.getline(part.data(), static_cast<std::streamsize>(part.size()));
    const auto read = static_cast<std::size_t>(stream.gcount());
    any = any || read > 0;
    const bool goes_on = stream.fail() && read > 0 && !stream.eof();
    // An end of the line counts as read.
    const std::size_t letters =
        goes_on || stream.eof() ? read : read - std::min<std::size_t>(read, 1);
    line.append(part.data(), std::min(letters, most - std::min(most, line.size())));
    if (!goes_on) return any;
    stream.clear();
  }
}

class Reader {
 public:
  Reader(const ReportReadOptions& options, const MapLoader& load_map, const SceneLoader& load_scene)
      : options_(options), load_map_(load_map), load_scene_(load_scene), root_(options.folder) {}

  ReportReadResult read(const Outline& outline) {
    ReportReadResult result;
    ReportContent& content = result.content;
    content.title = outline.title;
    content.text = outline.text;
    for (const OutlineItem& item : outline.items) content.items.push_back(read_item(item, root_));
    for (const OutlineSection& section : outline.sections)
      content.sections.push_back(read_section(section, root_));
    add_sources(content);
    result.files = std::move(files_);
    return result;
  }

 private:
  fs::path resolve(const fs::path& folder, const std::string& file) const {
    if (!file.starts_with(data_variable)) return (folder / file).lexically_normal();
    const char* data = std::getenv("GRASPMAP_DATA");  // NOLINT: nothing sets it meanwhile
    if (data == nullptr) return file;
    return fs::path(data) / file.substr(data_variable.size());
  }

  // As it is named in the report: relative to the run's folder.
  std::string name_of(const fs::path& path) const {
    const fs::path name = path.lexically_relative(root_.lexically_normal());
    if (name.empty() || *name.begin() == "..") return path.filename().string();
    return name.string();
  }

  void use(const fs::path& path) {
    if (std::find(files_.begin(), files_.end(), path) == files_.end()) files_.push_back(path);
  }

  // Reads a file by `reader`, or leaves a gap. What is broken is said, not thrown.
  template <typename Body>
  void fill(ReportItem& item, const fs::path& path, const Body& reader) {
    if (!is_there(path)) {
      item.gaps.push_back({name_of(path), ""});
      return;
    }
    try {
      reader();
    } catch (const Error& error) {
      const std::string field = error.context().field;
      item.gaps.push_back(
          {name_of(path), field.empty() ? error.reason() : field + ": " + error.reason()});
    }
  }

  ReportSection read_section(const OutlineSection& outline, const fs::path& around) {
    const fs::path folder = (around / outline.folder).lexically_normal();
    ReportSection section{.heading = outline.heading,
                          .folder = name_of(without_trailing_slash(folder)),
                          .text = outline.text};
    if (section.folder == ".") section.folder.clear();
    if (!outline.required_file.empty() && !is_there(resolve(folder, outline.required_file))) {
      section.gaps.push_back({name_of(resolve(folder, outline.required_file)), ""});
      return section;
    }
    for (const OutlineItem& item : outline.items) section.items.push_back(read_item(item, folder));
    for (const OutlineSection& inner : outline.sections)
      section.sections.push_back(read_section(inner, folder));
    return section;
  }

  ReportItem read_item(const OutlineItem& outline, const fs::path& folder) {
    ReportItem item{.caption = outline.caption};
    if (outline.files.size() == 1) item.source = name_of(resolve(folder, outline.files.front()));
    switch (outline.kind) {
      case ItemKind::picture:
        read_pictures(outline, folder, item);
        break;
      case ItemKind::table:
        read_table(outline, resolve(folder, outline.files.front()), item);
        break;
      case ItemKind::map:
        read_map(outline, folder, item);
        break;
      case ItemKind::scene:
        read_scene(resolve(folder, outline.files.front()), item);
        break;
      case ItemKind::parameters:
        read_parameters(outline, folder, item);
        break;
      case ItemKind::values:
        read_values(outline, folder, item);
        break;
      case ItemKind::timings:
        read_timings(outline, folder, item);
        break;
      case ItemKind::listing:
        read_listing(resolve(folder, outline.files.front()), item);
        break;
      case ItemKind::note:
        item.body = ReportNote{outline.text};
        break;
    }
    return item;
  }

  std::optional<ReportPicture> read_picture(const fs::path& path, ReportItem& item) {
    std::optional<ReportPicture> picture;
    fill(item, path, [&] {
      picture = read_picture_bytes(read_whole_file(path, max_picture_bytes));
      picture->file = name_of(path);
      use(path);
    });
    return picture;
  }

  void read_pictures(const OutlineItem& outline, const fs::path& folder, ReportItem& item) {
    ReportPictures pictures;
    for (std::size_t n = 0; n < outline.files.size(); ++n) {
      auto picture = read_picture(resolve(folder, outline.files[n]), item);
      if (!picture) continue;
      if (!outline.labels.empty()) picture->label = outline.labels[n];
      pictures.push_back(std::move(*picture));
    }
    if (!pictures.empty()) item.body = std::move(pictures);
  }

  void read_table(const OutlineItem& outline, const fs::path& path, ReportItem& item) {
    fill(item, path, [&] {
      item.body = read_report_table(path, outline.columns, outline.rows, options_.max_rows);
      use(path);
    });
  }

  void read_map(const OutlineItem& outline, const fs::path& folder, ReportItem& item) {
    const fs::path path = resolve(folder, outline.files.front());
    std::optional<fs::path> lookup;
    if (!outline.lookup.empty()) lookup = resolve(folder, outline.lookup);
    if (lookup && !is_there(*lookup)) {
      item.gaps.push_back({name_of(*lookup), ""});
      lookup.reset();
    }
    fill(item, path, [&] {
      ReportMap map;
      if (lookup) map.locations = read_locations(*lookup, outline, item);
      map.view = load_map_(path, map.locations ? lookup : std::nullopt);
      use(path);
      if (map.locations) name_markers(*lookup, outline, map);
      if (!outline.picture.empty())
        map.still = read_picture(resolve(folder, outline.picture), item);
      item.body = std::move(map);
    });
  }

  void read_scene(const fs::path& path, ReportItem& item) {
    fill(item, path, [&] {
      item.body = load_scene_(path);
      use(path);
    });
  }

  std::optional<ReportTable> read_locations(const fs::path& path, const OutlineItem& outline,
                                            ReportItem& item) {
    std::optional<ReportTable> table;
    fill(item, path, [&] {
      table = read_report_table(path, outline.columns, options_.max_rows, options_.max_rows);
      if (table->lines) throw Error("has too many rows for a view");
      use(path);
    });
    if (table && table->lines) table.reset();
    return table;
  }

  // By the first column of the file. Verdicts stand in the column asked for, or in `graspable`
  // where the points brought their own: the map's is then `map_graspable`.
  static void name_markers(const fs::path& path, const OutlineItem& outline, ReportMap& map) {
    const Table all = read_csv(path);
    std::optional<std::size_t> verdict;
    if (!outline.verdict.empty())
      verdict = all.column(outline.verdict);
    else if (all.find_column("map_graspable"))
      verdict = all.find_column("graspable");
    std::vector<MapMarker>& markers = map.view.markers;
    for (std::size_t row = 0; row < std::min(markers.size(), all.rows.size()); ++row) {
      markers[row].label = all.rows[row].front();
      if (verdict) markers[row].verdict = parse_bool(all.rows[row][*verdict]);
    }
  }

  void read_parameters(const OutlineItem& outline, const fs::path& folder, ReportItem& item) {
    ReportParameters parameters;
    for (std::size_t n = 0; n < outline.files.size(); ++n) {
      const fs::path output = without_trailing_slash(resolve(folder, outline.files[n]));
      fill(item, manifest_path(output), [&] {
        auto manifest = read_manifest_of(output);
        if (!manifest) return;
        use(manifest_path(output));
        parameters.outputs.emplace_back(
            outline.labels.empty() ? name_of(output) : outline.labels[n], std::move(*manifest));
      });
    }
    if (!parameters.outputs.empty()) item.body = std::move(parameters);
  }

  void read_values(const OutlineItem& outline, const fs::path& folder, ReportItem& item) {
    ReportValues values;
    for (const OutlineValue& asked : outline.values) {
      const fs::path path = resolve(folder, asked.file);
      ReportValue& value = values.emplace_back();
      value = {asked.label, "", asked.unit, asked.published};
      fill(item, path, [&] {
        try {
          const auto json =
              parse_json<nlohmann::ordered_json>(read_whole_file(path, max_json_bytes));
          value.value = text_of(json.at(nlohmann::ordered_json::json_pointer(asked.at)));
        } catch (const nlohmann::json::parse_error&) {
          throw Error("is no JSON, or '" + asked.at + "' no place in it");
        } catch (const nlohmann::json::exception&) {
          throw Error("there is nothing at " + asked.at);
        }
        use(path);
      });
    }
    item.body = std::move(values);
  }

  void read_timings(const OutlineItem& outline, const fs::path& folder, ReportItem& item) {
    std::vector<TimingCase> cases;
    for (const OutlineCase& asked : outline.cases) {
      TimingCase one{asked.name, {}};
      for (ReportSource& source : sources_of(asked, folder, item))
        if (is_timed(outline, source.manifest)) one.manifests.push_back(std::move(source.manifest));
      // In the order in which the commands are named.
      const auto rank = [&](const Manifest& manifest) {
        return std::find(outline.commands.begin(), outline.commands.end(), manifest.command);
      };
      std::stable_sort(one.manifests.begin(), one.manifests.end(),
                       [&](const Manifest& a, const Manifest& b) { return rank(a) < rank(b); });
      if (!one.manifests.empty()) cases.push_back(std::move(one));
    }
    if (cases.empty()) return;
    TimingTable table = timing_table(cases);
    if (!outline.published.file.empty()) {
      const fs::path path = resolve(folder, outline.published.file);
      fill(item, path, [&] {
        const Table published = read_csv(path);
        TimingTable with_published = table;
        add_published_times(published, outline.published, with_published);
        table = std::move(with_published);
        use(path);
      });
    }
    item.body = std::move(table);
  }

  static bool is_timed(const OutlineItem& outline, const Manifest& manifest) {
    if (manifest.timings_s.empty()) return false;
    if (outline.commands.empty())
      return manifest.command != "render" && manifest.command != "report";
    return std::find(outline.commands.begin(), outline.commands.end(), manifest.command) !=
           outline.commands.end();
  }

  std::vector<ReportSource> sources_of(const OutlineCase& asked, const fs::path& folder,
                                       ReportItem& item) {
    std::vector<ReportSource> sources;
    if (!asked.folder.empty()) {
      const fs::path inner = resolve(folder, asked.folder);
      if (!is_there(inner)) item.gaps.push_back({name_of(without_trailing_slash(inner)), ""});
      sources = manifests_below(inner, true);
      std::erase_if(sources, [](const ReportSource& source) { return !source.error.empty(); });
      return sources;
    }
    for (const std::string& file : asked.files) {
      const fs::path output = without_trailing_slash(resolve(folder, file));
      fill(item, manifest_path(output), [&] {
        if (auto manifest = read_manifest_of(output))
          sources.push_back({output.string(), std::move(*manifest), ""});
      });
    }
    return sources;
  }

  void read_listing(const fs::path& path, ReportItem& item) {
    fill(item, path, [&] {
      require_readable_file(path);
      std::ifstream stream(path);
      ReportListing listing;
      std::size_t lines = 0;
      constexpr std::size_t max_line = 400;
      for (std::string line; next_line(stream, max_line + 1, line); ++lines) {
        if (lines >= options_.max_lines) continue;
        listing.text += line.size() > max_line ? line.substr(0, max_line) + " ..." : line;
        listing.text += '\n';
      }
      listing.left_out_lines = lines - std::min(lines, options_.max_lines);
      item.body = std::move(listing);
      use(path);
    });
  }

  void add_sources(ReportContent& content) {
    content.sources = manifests_below(root_, false);
    const std::string itself = options_.left_out.lexically_normal().string();
    std::erase_if(content.sources, [&](const ReportSource& source) {
      return fs::path(source.output).lexically_normal() == itself ||
             source.manifest.command == "report";
    });
    if (content.sources.size() > options_.max_sources) {
      content.more_sources = content.sources.size() - options_.max_sources;
      content.sources.resize(options_.max_sources);
    }
    for (ReportSource& source : content.sources)
      source.output = name_of(fs::path(source.output).lexically_normal());
  }

  const ReportReadOptions& options_;
  const MapLoader& load_map_;
  const SceneLoader& load_scene_;
  fs::path root_;
  std::vector<fs::path> files_;
};

}  // namespace

ReportReadResult read_report_content(const Outline& outline, const ReportReadOptions& options,
                                     const MapLoader& load_map, const SceneLoader& load_scene) {
  std::error_code code;
  if (!fs::is_directory(options.folder, code))
    throw Error(is_there(options.folder) ? "is no folder" : "no such folder",
                {.file = options.folder.string()});
  return Reader(options, load_map, load_scene).read(outline);
}

}  // namespace libmap

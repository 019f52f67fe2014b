#include "libmap/report/report_reader.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <string_view>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/report/image_fit.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t max_image_bytes = std::uint64_t{64} << 20;
// Commands whose running times are shown, in this order.
constexpr std::array timed_commands = {
    "simulate scene", "simulate site", "simulate cameras", "fuse",   "mesh",     "crop",
    "resample",       "score",         "convert",          "lookup", "evaluate", "footholds",
    "analyze"};

constexpr std::size_t head_bytes = std::size_t{4} << 20;

struct FileHead {
  std::string text;
  std::uint64_t lines = 0;  // of the whole file
  bool whole = true;
};

// Removes an incomplete last row: cuts at the last newline outside of quotes.
void cut_at_row(std::string& text) {
  auto quotes = std::count(text.begin(), text.end(), '"');
  while (!text.empty()) {
    const std::size_t end = text.find_last_of('\n');
    if (end == std::string::npos) return;
    quotes -= std::count(text.begin() + static_cast<std::ptrdiff_t>(end), text.end(), '"');
    text.resize(end);
    if (quotes % 2 == 0) return;
  }
}

FileHead read_head(const std::filesystem::path& path) {
  require_readable_file(path);
  FileHead head;
  std::ifstream stream(path, std::ios::binary);
  head.text.resize(head_bytes);
  stream.read(head.text.data(), static_cast<std::streamsize>(head_bytes));
  head.text.resize(static_cast<std::size_t>(stream.gcount()));
  head.lines = static_cast<std::uint64_t>(std::count(head.text.begin(), head.text.end(), '\n'));
  char last = head.text.empty() ? '\n' : head.text.back();
  std::string more(head_bytes, '\0');
  while (stream.read(more.data(), static_cast<std::streamsize>(head_bytes)) ||
         stream.gcount() > 0) {
    head.whole = false;
    head.lines +=
        static_cast<std::uint64_t>(std::count(more.begin(), more.begin() + stream.gcount(), '\n'));
    last = more[static_cast<std::size_t>(stream.gcount()) - 1];
  }
  if (last != '\n') ++head.lines;
  if (!head.whole) cut_at_row(head.text);
  return head;
}

class Reader {
 public:
  Reader(const ReportReadOptions& options, const MapLoader& load_map, const SceneLoader& load_scene)
      : options_(options), load_map_(load_map), load_scene_(load_scene), root_(options.folder) {}

  ReportReadResult read(const PlannedSection& plan) {
    ReportReadResult result;
    static_cast<ReportSection&>(result.content) = read_section(plan);
    add_sources(result.content);
    result.files = std::move(files_);
    return result;
  }

 private:
  // Name of a file in the report: its path relative to the run's folder.
  std::string name_of(const fs::path& path) const {
    return path.lexically_normal().lexically_relative(root_.lexically_normal()).string();
  }

  void use(const fs::path& path) {
    const fs::path file = path.lexically_normal();
    if (std::find(files_.begin(), files_.end(), file) == files_.end()) files_.push_back(file);
  }

  // Calls `reader`; an Error becomes a gap.
  template <typename Body>
  void fill(ReportItem& item, const fs::path& path, const Body& reader) {
    try {
      reader();
    } catch (const Error& error) {
      const std::string field = error.context().field;
      item.gaps.push_back(
          {name_of(path), field.empty() ? error.reason() : field + ": " + error.reason()});
    }
  }

  ReportSection read_section(const PlannedSection& plan) {
    ReportSection section{.heading = plan.heading, .folder = name_of(plan.folder)};
    if (section.folder == ".") section.folder.clear();
    for (const PlannedItem& item : plan.items) section.items.push_back(read_item(item));
    for (const PlannedSection& inner : plan.sections)
      section.sections.push_back(read_section(inner));
    return section;
  }

  ReportItem read_item(const PlannedItem& plan) {
    ReportItem item{.caption = plan.caption};
    if (plan.files.size() == 1) item.source = name_of(plan.files.front());
    switch (plan.kind) {
      case ItemKind::image:
        read_images(plan, item);
        break;
      case ItemKind::table:
        fill(item, plan.files.front(), [&] {
          item.body = read_report_table(plan.files.front(), {}, options_.max_rows);
          use(plan.files.front());
        });
        break;
      case ItemKind::map:
        read_map(plan, item);
        break;
      case ItemKind::scene:
        fill(item, plan.files.front(), [&] {
          item.body = load_scene_(plan.files.front());
          use(plan.files.front());
        });
        break;
      case ItemKind::parameters:
        read_parameters(plan, item);
        break;
      case ItemKind::timings:
        read_timings(plan, item);
        break;
      case ItemKind::listing:
        read_listing(plan.files.front(), item);
        break;
    }
    return item;
  }

  std::optional<ReportImage> read_image(const fs::path& path, ReportItem& item) {
    std::optional<ReportImage> image;
    fill(item, path, [&] {
      image = read_image_bytes(read_whole_file(path, max_image_bytes));
      image->file = name_of(path);
      use(path);
    });
    return image;
  }

  void read_images(const PlannedItem& plan, ReportItem& item) {
    ReportImages images;
    for (std::size_t n = 0; n < plan.files.size(); ++n) {
      auto image = read_image(plan.files[n], item);
      if (!image) continue;
      if (!plan.labels.empty()) image->label = plan.labels[n];
      images.push_back(std::move(*image));
    }
    if (!images.empty()) item.body = std::move(images);
  }

  void read_map(const PlannedItem& plan, ReportItem& item) {
    const fs::path& path = plan.files.front();
    fill(item, path, [&] {
      ReportMap map;
      if (!plan.lookup.empty()) map.locations = read_locations(plan, item);
      map.view = load_map_(path, map.locations ? std::optional(plan.lookup) : std::nullopt);
      use(path);
      if (map.locations) name_markers(plan.lookup, map);
      if (!plan.image.empty()) map.preview = read_image(plan.image, item);
      item.body = std::move(map);
    });
  }

  std::optional<ReportTable> read_locations(const PlannedItem& plan, ReportItem& item) {
    std::optional<ReportTable> table;
    fill(item, plan.lookup, [&] {
      table = read_report_table(plan.lookup, plan.columns, options_.max_rows);
      if (table->lines) throw Error("too many rows; only the map is shown");
      use(plan.lookup);
    });
    if (table && table->lines) table.reset();
    return table;
  }

  // Labels markers by the first column. If the points already had verdicts, these are in
  // `graspable` and those of the map in `map_graspable`.
  static void name_markers(const fs::path& path, ReportMap& map) {
    const Table all = read_csv(path);
    std::optional<std::size_t> verdict;
    if (all.find_column("map_graspable")) verdict = all.find_column("graspable");
    std::vector<MapMarker>& markers = map.view.markers;
    for (std::size_t row = 0; row < std::min(markers.size(), all.rows.size()); ++row) {
      markers[row].label = all.rows[row].front();
      if (verdict) markers[row].verdict = parse_bool(all.rows[row][*verdict]);
    }
  }

  void read_parameters(const PlannedItem& plan, ReportItem& item) {
    ReportParameters parameters;
    for (std::size_t n = 0; n < plan.files.size(); ++n) {
      const fs::path& output = plan.files[n];
      fill(item, manifest_path(output), [&] {
        auto manifest = read_manifest_of(output);
        if (!manifest) return;
        use(manifest_path(output));
        parameters.outputs.emplace_back(plan.labels[n], std::move(*manifest));
      });
    }
    if (!parameters.outputs.empty()) item.body = std::move(parameters);
  }

  void read_timings(const PlannedItem& plan, ReportItem& item) {
    const auto rank = [](const Manifest& manifest) {
      return std::find(timed_commands.begin(), timed_commands.end(), manifest.command);
    };
    std::vector<std::pair<std::string, std::vector<Manifest>>> cases;
    for (const auto& [name, outputs] : plan.cases) {
      std::vector<Manifest> manifests;
      for (const fs::path& output : outputs)
        fill(item, manifest_path(output), [&] {
          auto manifest = read_manifest_of(output);
          if (manifest && !manifest->timings_s.empty() && rank(*manifest) != timed_commands.end())
            manifests.push_back(std::move(*manifest));
        });
      std::stable_sort(manifests.begin(), manifests.end(),
                       [&](const Manifest& a, const Manifest& b) { return rank(a) < rank(b); });
      if (!manifests.empty()) cases.emplace_back(name, std::move(manifests));
    }
    if (!cases.empty()) item.body = timing_table(cases);
  }

  void read_listing(const fs::path& path, ReportItem& item) {
    fill(item, path, [&] {
      constexpr std::size_t max_line = 400;
      const FileHead head = read_head(path);
      ReportListing listing;
      std::size_t lines = 0;
      std::string_view rest = head.text;
      for (; lines < options_.max_lines && !rest.empty(); ++lines) {
        const std::string_view line = rest.substr(0, rest.find('\n'));
        listing.text += line.substr(0, max_line);
        listing.text += line.size() > max_line ? " ...\n" : "\n";
        rest.remove_prefix(std::min(rest.size(), line.size() + 1));
      }
      listing.omitted_lines = head.lines - lines;
      item.body = std::move(listing);
      use(path);
    });
  }

  void add_sources(ReportContent& content) {
    content.sources = manifests_below(root_, false);
    const std::string itself = options_.excluded.lexically_normal().string();
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

ReportReadResult read_report_content(const PlannedSection& plan, const ReportReadOptions& options,
                                     const MapLoader& load_map, const SceneLoader& load_scene) {
  return Reader(options, load_map, load_scene).read(plan);
}

ReportTable read_report_table(const fs::path& path, const TableColumns& columns,
                              std::size_t max_rows) {
  const FileHead head = read_head(path);
  Table all = parse_csv(head.text, path.string());
  ReportTable shown;
  if (!head.whole)
    shown.lines = head.lines;
  else if (all.rows.size() > max_rows)
    shown.lines = all.rows.size() + 1;
  std::vector<std::size_t> column_indices;
  for (const auto& [name, heading] : columns) {
    column_indices.push_back(all.column(name));
    shown.table.columns.push_back(name);
    shown.headings.push_back(heading);
  }
  if (all.rows.size() > max_rows) all.rows.resize(max_rows);
  if (columns.empty()) {
    shown.headings = all.columns;
    shown.table = std::move(all);
    return shown;
  }
  shown.table.file = all.file;
  for (const std::vector<std::string>& row : all.rows) {
    std::vector<std::string>& cells = shown.table.rows.emplace_back();
    for (const std::size_t entry : column_indices) cells.push_back(row[entry]);
  }
  return shown;
}

TimingTable timing_table(const std::vector<std::pair<std::string, std::vector<Manifest>>>& cases) {
  TimingTable table;
  for (const auto& one : cases) table.cases.push_back(one.first);
  std::map<std::pair<std::string, std::string>, std::size_t> row_of;  // by command and step
  std::map<std::string, std::size_t> rank_of;                         // by command
  for (std::size_t n = 0; n < cases.size(); ++n) {
    std::vector<unsigned>& threads = table.threads.emplace_back();
    for (const Manifest& manifest : cases[n].second) {
      if (std::find(threads.begin(), threads.end(), manifest.threads) == threads.end())
        threads.push_back(manifest.threads);
      for (const auto& [step, seconds] : manifest.timings_s) {
        const auto [entry, is_new] =
            row_of.try_emplace({manifest.command, step}, table.rows.size());
        rank_of.try_emplace(manifest.command, rank_of.size());
        if (is_new)
          table.rows.push_back(
              {manifest.command, step, std::vector<std::optional<double>>(cases.size())});
        std::optional<double>& cell = table.rows[entry->second].seconds[n];
        table.sums = table.sums || cell.has_value();
        cell = cell.value_or(0.0) + seconds;
      }
    }
    std::sort(threads.begin(), threads.end());
  }
  // Groups rows by command.
  std::stable_sort(table.rows.begin(), table.rows.end(), [&](const auto& a, const auto& b) {
    return rank_of.at(a.command) < rank_of.at(b.command);
  });
  return table;
}

}  // namespace libmap

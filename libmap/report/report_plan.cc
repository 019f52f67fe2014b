
#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <system_error>

#include "libmap/core/error.h"
#include "libmap/report/report_reader.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr int max_folder_depth = 12;  // below a run's folder

struct FolderListing {
  std::vector<fs::path> files;
  std::vector<fs::path> folders;
};

// Lists a folder in natural order, without hidden names and links to folders, which may be cyclic.
// Empty if the folder cannot be read.
FolderListing list_folder(const fs::path& folder) {
  FolderListing listing;
  std::error_code code;
  for (auto entry = fs::directory_iterator(folder, code);
       !code && entry != fs::directory_iterator(); entry.increment(code)) {
    std::error_code ignored;
    if (entry->path().filename().string().starts_with('.')) continue;
    if (entry->is_directory(ignored)) {
      if (!entry->is_symlink(ignored)) listing.folders.push_back(entry->path());
    } else if (entry->is_regular_file(ignored)) {
      listing.files.push_back(entry->path());
    }
  }
  const auto by_name = [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  };
  std::sort(listing.files.begin(), listing.files.end(), by_name);
  std::sort(listing.folders.begin(), listing.folders.end(), by_name);
  return listing;
}

// Returns true for tile stores and for folders with the shares of a map.
bool is_folder_of_tiles(const fs::path& folder) {
  return folder.extension() == ".tiles" || folder.filename() == "tiles";
}

void add_manifests(const fs::path& folder, bool tiles, int depth,
                   std::vector<ReportSource>& sources) {
  const FolderListing listing = list_folder(folder);
  for (const fs::path& file : listing.files) {
    if (file.extension() != ".json") continue;
    fs::path output = file;
    output.replace_extension();
    std::error_code code;
    if (!fs::exists(output, code)) continue;
    ReportSource& source = sources.emplace_back();
    source.output = output.string();
    try {
      if (auto manifest = read_manifest_of(output)) source.manifest = std::move(*manifest);
    } catch (const Error& error) {
      source.error = error.reason();
    }
  }
  if (depth == max_folder_depth) return;
  for (const fs::path& inner : listing.folders)
    if (inner.extension() != ".tiles" && (tiles || !is_folder_of_tiles(inner)))
      add_manifests(inner, tiles, depth + 1, sources);
}

bool has_extension(const fs::path& file, const std::set<fs::path>& extensions) {
  return extensions.contains(file.extension());
}

// Maps are identified by their manifests.
bool is_map(const fs::path& file, const std::optional<Manifest>& manifest) {
  return manifest && has_extension(file, {".pcd", ".ply", ".csv", ".tiles"}) &&
         (manifest->command == "score" ||
          ((manifest->command == "convert" || manifest->command == "grasp") &&
           manifest->find_result("scored_voxels") != nullptr));
}

// Heading of a folder: "2_slopes_and_bumps" -> "2 Slopes and bumps".
std::string heading_of(const fs::path& folder) {
  std::string heading = folder.filename().string();
  if (heading == "roc") return "ROC";
  std::replace(heading.begin(), heading.end(), '_', ' ');
  const std::size_t first = heading.find_first_not_of("0123456789 .-");
  if (first != std::string::npos && heading[first] >= 'a' && heading[first] <= 'z')
    heading[first] = static_cast<char>(heading[first] - 'a' + 'A');
  return heading;
}

class Finder {
 public:
  Finder(fs::path folder, fs::path name) : root_(std::move(folder)), root_name_(std::move(name)) {}

  PlannedSection section_of(const fs::path& folder, int depth) {
    PlannedSection section;
    section.heading = heading_of(folder);
    section.folder = folder;
    const FolderListing listing = list_folder(folder);
    add_maps(listing, section);
    add_scenes(folder, listing, section);
    add_images(listing, section);
    add_tables(listing, section);
    add_texts(listing, section);
    manifests_.clear();
    if (depth == max_folder_depth) return section;
    for (const fs::path& inner : listing.folders) {
      if (is_folder_of_tiles(inner)) continue;
      PlannedSection part = section_of(inner, depth + 1);
      if (!part.items.empty() || !part.sections.empty())
        section.sections.push_back(std::move(part));
    }
    return section;
  }

  // Plans the comparison of the parameters of all maps.
  std::vector<PlannedItem> overview() const {
    if (maps_.empty()) return {};
    PlannedItem parameters{.kind = ItemKind::parameters};
    for (const fs::path& map : maps_) {
      parameters.files.push_back(map);
      parameters.labels.push_back(label_of(map));
    }
    parameters.caption = maps_.size() == 1 ? "The map of this run." : "The maps of this run.";
    return {std::move(parameters)};
  }

  // Plans one case per folder with a map: its outputs and those of subfolders without a map.
  std::vector<PlannedSection> running_times() const {
    PlannedItem timings{.kind = ItemKind::timings};
    std::set<fs::path> known;
    for (const fs::path& map : maps_) {
      const fs::path folder = map.parent_path();
      if (!known.insert(folder).second) continue;
      auto& [name, outputs] = timings.cases.emplace_back();
      name = maps_in(folder) == 1 ? label_of(map) : name_of(folder);
      for (const ReportSource& source : manifests_below(folder, true))
        if (source.error.empty() && folder_with_map_of(source.output) == folder)
          outputs.emplace_back(source.output);
    }
    if (timings.cases.empty()) return {};
    timings.caption = "Running times.";
    return {{.heading = "Running times", .folder = root_, .items = {std::move(timings)}}};
  }

 private:
  int maps_in(const fs::path& folder) const {
    const auto found = maps_in_.find(folder);
    return found == maps_in_.end() ? 0 : found->second;
  }

  // Manifest of an output, cached because each map is compared with all files beside it.
  const std::optional<Manifest>& manifest_of(const fs::path& output) {
    const auto [cached, added] = manifests_.try_emplace(output);
    if (!added) return cached->second;
    try {
      cached->second = read_manifest_of(output);
    } catch (const Error&) {
      cached->second.reset();  // unreadable manifests are ignored
    }
    return cached->second;
  }

  // Nearest parent folder of `output` with a map.
  fs::path folder_with_map_of(const fs::path& output) const {
    fs::path folder = output.parent_path();
    while (maps_in(folder) == 0 && folder != root_ && folder.has_relative_path())
      folder = folder.parent_path();
    return folder;
  }

  std::string name_of(const fs::path& folder) const {
    return folder == root_ ? root_name_.string() : folder.lexically_relative(root_).string();
  }

  // Name of a map: its folder, or its path if it is in the run's folder or beside other maps.
  std::string label_of(const fs::path& map) const {
    const bool alone = map.parent_path() != root_ && maps_in(map.parent_path()) == 1;
    return alone ? name_of(map.parent_path()) : map.lexically_relative(root_).string();
  }

  void add_maps(const FolderListing& listing, PlannedSection& section) {
    std::vector<fs::path> candidates = listing.files;
    candidates.insert(candidates.end(), listing.folders.begin(), listing.folders.end());
    std::set<std::string> stems;
    std::erase_if(candidates, [&](const fs::path& file) {
      return !is_map(file, manifest_of(file)) || !stems.insert(file.stem().string()).second;
    });
    for (const fs::path& file : candidates) {
      maps_.push_back(file);
      ++maps_in_[file.parent_path()];
      PlannedItem item{.kind = ItemKind::map, .files = {file}};
      item.lookup = lookup_of(file, listing);
      if (!item.lookup.empty()) item.columns = columns_of(item.lookup);
      item.image = still_of(file, listing, candidates.size() == 1);
      section.items.push_back(std::move(item));
    }
  }

  // Adds the scenes of `grasp`. The folder's manifest contains the result of each trial.
  void add_scenes(const fs::path& folder, const FolderListing& listing, PlannedSection& section) {
    const auto& manifest = manifest_of(folder);
    if (!manifest || manifest->command != "grasp") return;
    for (const fs::path& file : listing.files) {
      const std::string name = file.filename().string();
      const ManifestValue* result = manifest->find_result(name);
      const auto* text = result == nullptr ? nullptr : std::get_if<std::string>(result);
      if (text != nullptr)
        section.items.push_back({.kind = ItemKind::scene,
                                 .files = {file},
                                 .caption = file.stem().string() + ": " + *text + "."});
    }
  }

  // Table of look-ups whose manifest names this map; empty if there is none.
  fs::path lookup_of(const fs::path& map, const FolderListing& listing) {
    for (const fs::path& file : listing.files) {
      if (file.extension() != ".csv") continue;
      const auto& manifest = manifest_of(file);
      if (manifest && manifest->command == "lookup" && !manifest->inputs.empty() &&
          fs::path(manifest->inputs.front().path).filename() == map.filename())
        return file;
    }
    return {};
  }

  // The most important columns of a table of look-ups.
  static TableColumns columns_of(const fs::path& lookup) {
    try {
      const Table table = read_report_table(lookup, {}, 1).table;
      // If the points already had verdicts, the verdict of the map is `map_graspable`.
      const bool verdicts = table.find_column("map_graspable").has_value();
      const std::string& name = table.columns.front();
      TableColumns columns = {{name, name}};
      for (const auto& [column, heading] :
           {std::pair{"graspable", verdicts ? "verdict" : "graspable on the map"},
            {"score", "score"},
            {"convex", "convex"},
            {"map_graspable", "graspable on the map"}})
        if (table.find_column(column).value_or(0) > 0) columns.emplace_back(column, heading);
      return columns.size() > 1 ? columns : TableColumns{};
    } catch (const Error&) {
      return {};
    }
  }

  // Image of the map according to the image's manifest. An image without a manifest is assigned to
  // the only map of a folder.
  fs::path still_of(const fs::path& map, const FolderListing& listing, bool only_map) {
    const auto shows = [&](const fs::path& image) {
      const auto& manifest = manifest_of(image);
      if (!manifest || manifest->inputs.empty()) return only_map;
      return fs::path(manifest->inputs.front().path).stem() == map.stem();
    };
    for (const std::string& name :
         {map.stem().string() + ".png", std::string("oblique.png"), std::string("top.png")})
      for (const fs::path& file : listing.files)
        if (file.filename() == name && (name == map.stem().string() + ".png" || shows(file)))
          return file;
    return {};
  }

  // Adds one figure with all images and one per chart. Images that also exist as SVG are omitted.
  static void add_images(const FolderListing& listing, PlannedSection& section) {
    PlannedItem images{.kind = ItemKind::image};
    std::vector<PlannedItem> charts;
    const auto drawn = [&](const fs::path& file) {
      const fs::path drawing = fs::path(file).replace_extension(".svg");
      return drawing != file &&
             std::find(listing.files.begin(), listing.files.end(), drawing) != listing.files.end();
    };
    const auto drawn_below = [&](const fs::path& file) {
      std::error_code code;
      const std::string drawing = file.stem().string() + ".svg";
      return fs::exists(file.parent_path() / "evaluation" / drawing, code);
    };
    for (const fs::path& file : listing.files) {
      if (!has_extension(file, {".png", ".jpg", ".jpeg", ".svg"}) || drawn(file) ||
          drawn_below(file))
        continue;
      if (file.extension() == ".svg") {
        charts.push_back(
            {.kind = ItemKind::image, .files = {file}, .caption = heading_of(file.stem()) + "."});
        continue;
      }
      images.files.push_back(file);
      images.labels.push_back(heading_of(file.stem()));
    }
    // Several images have labels, a single one has a caption only.
    for (const std::string& label : images.labels)
      images.caption += (images.caption.empty() ? "" : ", ") + label;
    if (!images.caption.empty()) images.caption += '.';
    if (images.files.size() == 1) images.labels.clear();
    if (!images.files.empty()) section.items.push_back(std::move(images));
    for (PlannedItem& chart : charts) section.items.push_back(std::move(chart));
  }

  // Adds tables, except clouds and look-ups that are shown with their map.
  static void add_tables(const FolderListing& listing, PlannedSection& section) {
    for (const fs::path& file : listing.files) {
      const bool beside_map =
          std::any_of(section.items.begin(), section.items.end(), [&](const PlannedItem& item) {
            return item.lookup == file ||
                   (item.kind == ItemKind::map && item.files.front() == file);
          });
      if (file.extension() == ".csv" && !beside_map)
        section.items.push_back(
            {.kind = ItemKind::table, .files = {file}, .caption = heading_of(file.stem()) + "."});
    }
  }

  static void add_texts(const FolderListing& listing, PlannedSection& section) {
    for (const fs::path& file : listing.files)
      if (file.extension() == ".txt")
        section.items.push_back(
            {.kind = ItemKind::listing, .files = {file}, .caption = heading_of(file.stem()) + "."});
  }

  fs::path root_;
  fs::path root_name_;
  std::vector<fs::path> maps_;
  std::map<fs::path, int> maps_in_;
  std::map<fs::path, std::optional<Manifest>> manifests_;  // cache for the current folder
};

}  // namespace

std::size_t PlannedSection::count(ItemKind kind) const {
  std::size_t count = 0;
  for (const PlannedItem& item : items) count += item.kind == kind ? 1 : 0;
  for (const PlannedSection& section : sections) count += section.count(kind);
  return count;
}

bool natural_less(const std::string& a, const std::string& b) {
  return strverscmp(a.c_str(), b.c_str()) < 0;
}

std::vector<ReportSource> manifests_below(const fs::path& folder, bool tiles) {
  std::vector<ReportSource> sources;
  add_manifests(folder, tiles, 0, sources);
  return sources;
}

PlannedSection plan_report(const fs::path& folder) {
  std::error_code code;
  if (!fs::is_directory(folder, code))
    throw Error(fs::exists(folder, code) ? "not a folder" : "no such folder",
                {.file = folder.string()});
  const fs::path name = (fs::absolute(folder) / "").lexically_normal().parent_path().filename();
  fs::path root = folder.lexically_normal();
  if (!root.has_filename()) root = root.parent_path();
  Finder finder(root, name);
  PlannedSection plan = finder.section_of(root, 0);
  if (plan.items.empty() && plan.sections.empty())
    throw Error("nothing to report: the folder contains no map, image, table or text",
                {.file = folder.string()});
  plan.heading = name.empty() ? "Report" : heading_of(name);
  const std::vector<PlannedItem> overview = finder.overview();
  plan.items.insert(plan.items.begin(), overview.begin(), overview.end());
  for (PlannedSection& section : finder.running_times())
    plan.sections.push_back(std::move(section));
  return plan;
}

}  // namespace libmap

#include "libmap/report/outline_io.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdint>
#include <optional>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

constexpr int max_outline_depth = 12;

[[noreturn]] void fail(const YAML::Node& node, const std::string& field,
                       const std::string& reason) {
  const YAML::Mark mark = node.Mark();
  const std::string line = mark.is_null() ? "" : "line " + std::to_string(mark.line + 1) + ", ";
  throw Error(reason, {.field = line + field});
}

// A YAML map whose keys are asked for one by one; what was not asked for is an error.
class Keys {
 public:
  Keys(const YAML::Node& node, std::string name) : node_(node), name_(std::move(name)) {
    if (!node.IsMap()) fail(node, name_, "is no map of keys and values");
  }

  std::optional<YAML::Node> find(const std::string& key) {
    known_.push_back(key);
    const YAML::Node value = node_[key];
    if (!value.IsDefined() || value.IsNull()) return std::nullopt;
    return value;
  }

  std::string text(const std::string& key) {
    const auto value = find(key);
    return value ? scalar(*value, key) : "";
  }

  std::string required_text(const std::string& key) {
    std::string value = text(key);
    if (trim(value).empty()) fail(node_, name_, "has no '" + key + "'");
    return value;
  }

  // One text, or a list of them.
  std::vector<std::string> texts(const std::string& key) {
    const auto value = find(key);
    return value ? list_of(*value, key) : std::vector<std::string>{};
  }

  std::vector<std::pair<std::string, std::string>> pairs(const std::string& key) {
    std::vector<std::pair<std::string, std::string>> found;
    const auto value = find(key);
    if (!value) return found;
    if (!value->IsMap()) fail(*value, key, "is no map of keys and values");
    for (const auto& entry : *value)
      found.emplace_back(scalar(entry.first, key), scalar(entry.second, key));
    return found;
  }

  template <typename Reader>
  void each(const std::string& key, const Reader& reader) {
    const auto value = find(key);
    if (!value) return;
    if (!value->IsSequence()) fail(*value, key, "is no list");
    for (const YAML::Node& entry : *value) reader(entry);
  }

  // Call it when all that is known was asked for.
  void end() const {
    for (const auto& entry : node_) {
      const std::string key = scalar(entry.first, name_);
      if (std::find(known_.begin(), known_.end(), key) == known_.end())
        fail(entry.first, "key '" + key + "'",
             "is not known in a " + name_ + did_you_mean(key, known_));
      if (std::count_if(node_.begin(), node_.end(),
                        [&](const auto& other) { return scalar(other.first, name_) == key; }) > 1)
        fail(entry.first, "key '" + key + "'", "is a duplicate");
    }
  }

  const YAML::Node& node() const { return node_; }
  const std::string& name() const { return name_; }

  static std::string scalar(const YAML::Node& node, const std::string& key) {
    if (!node.IsScalar()) fail(node, key, "is no plain text");
    return node.Scalar();
  }

  static std::vector<std::string> list_of(const YAML::Node& node, const std::string& key) {
    if (node.IsScalar()) return {node.Scalar()};
    if (!node.IsSequence()) fail(node, key, "is neither a text nor a list of texts");
    std::vector<std::string> texts;
    for (const YAML::Node& entry : node) texts.push_back(scalar(entry, key));
    return texts;
  }

 private:
  YAML::Node node_;
  std::string name_;
  std::vector<std::string> known_;
};

OutlineColumn parse_column(const YAML::Node& node) {
  if (node.IsScalar()) return {node.Scalar(), node.Scalar()};
  if (!node.IsMap() || node.size() != 1)
    fail(node, "columns", "contains neither NAME nor NAME: TEXT");
  const auto entry = *node.begin();
  return {Keys::scalar(entry.first, "columns"), Keys::scalar(entry.second, "columns")};
}

OutlineValue parse_value(const YAML::Node& node) {
  Keys keys(node, "value");
  OutlineValue value;
  value.label = keys.required_text("label");
  value.file = keys.required_text("file");
  value.at = keys.required_text("at");
  value.unit = keys.text("unit");
  value.published = keys.text("published");
  keys.end();
  return value;
}

OutlineCase parse_case(const YAML::Node& node) {
  Keys keys(node, "case");
  OutlineCase one;
  one.name = keys.required_text("name");
  one.folder = keys.text("folder");
  one.files = keys.texts("files");
  keys.end();
  if (one.folder.empty() == one.files.empty())
    fail(node, "case '" + one.name + "'", "needs a folder or files");
  return one;
}

OutlinePublishedTimes parse_published(const YAML::Node& node) {
  Keys keys(node, "published");
  OutlinePublishedTimes published;
  published.file = keys.required_text("file");
  published.name_column = keys.text("name");
  published.columns = keys.pairs("columns");
  published.rows = keys.pairs("rows");
  keys.end();
  return published;
}

std::size_t parse_rows(const YAML::Node& node) {
  const auto rows = parse_integer(Keys::scalar(node, "rows"));
  if (!rows || *rows < 1 || *rows > 1'000'000) fail(node, "rows", "is no whole number from 1");
  return static_cast<std::size_t>(*rows);
}

void parse_content(Keys& keys, const YAML::Node& content, OutlineItem& item) {
  switch (item.kind) {
    case ItemKind::note:
      item.text = Keys::scalar(content, "note");
      break;
    case ItemKind::values:
    case ItemKind::timings:
      if (!content.IsSequence()) fail(content, keys.name(), "is no list");
      for (const YAML::Node& entry : content) {
        if (item.kind == ItemKind::values)
          item.values.push_back(parse_value(entry));
        else
          item.cases.push_back(parse_case(entry));
      }
      break;
    default:
      item.files = Keys::list_of(content, "path");
      if (item.files.empty()) fail(content, keys.name(), "names no file");
      if (item.files.size() > 1 && item.kind != ItemKind::picture &&
          item.kind != ItemKind::parameters)
        fail(content, keys.name(), "names more than one file");
  }
}

// What says how the content is shown; keys of other kinds are not known.
void parse_manner(Keys& keys, OutlineItem& item) {
  switch (item.kind) {
    case ItemKind::picture:
    case ItemKind::parameters:
      item.labels = keys.texts("labels");
      break;
    case ItemKind::map:
      item.lookup = keys.text("lookup");
      item.verdict = keys.text("verdict");
      item.picture = keys.text("picture");
      [[fallthrough]];
    case ItemKind::table:
      keys.each("columns", [&](const auto& entry) { item.columns.push_back(parse_column(entry)); });
      if (const auto rows = keys.find("rows")) item.rows = parse_rows(*rows);
      break;
    case ItemKind::timings:
      item.commands = keys.texts("commands");
      if (const auto published = keys.find("published"))
        item.published = parse_published(*published);
      break;
    default:
      break;
  }
}

OutlineItem parse_item(const YAML::Node& node) {
  Keys keys(node, "item");
  OutlineItem item;
  std::optional<YAML::Node> content;
  for (const auto& [name, kind] : item_kind_names()) {
    const auto found = keys.find(name);
    // The picture of a map is what stands in for its view.
    if (!found || (content && item.kind == ItemKind::map && name == "picture")) continue;
    if (content) fail(node, "item", "is of two kinds");
    content = found;
    item.kind = kind;
  }
  if (!content) {
    std::string kinds;
    for (const auto& [name, kind] : item_kind_names()) kinds += (kinds.empty() ? "" : ", ") + name;
    fail(node, "item", "is of no kind: " + kinds);
  }
  item.caption = keys.text("caption");
  parse_manner(keys, item);
  keys.end();
  parse_content(keys, *content, item);
  if (!item.labels.empty() && item.labels.size() != item.files.size())
    fail(node, "labels", "are not as many as the files");
  return item;
}

OutlineSection parse_section(const YAML::Node& node, int depth) {
  if (depth > max_outline_depth) fail(node, "sections", "lie deeper than 12 levels");
  Keys keys(node, "section");
  OutlineSection section;
  section.heading = keys.required_text("heading");
  section.folder = keys.text("folder");
  section.text = keys.text("text");
  section.required_file = keys.text("requires");
  keys.each("items", [&](const auto& entry) { section.items.push_back(parse_item(entry)); });
  keys.each("sections", [&](const auto& entry) {
    section.sections.push_back(parse_section(entry, depth + 1));
  });
  keys.end();
  return section;
}

}  // namespace

const std::vector<std::pair<std::string, ItemKind>>& item_kind_names() {
  static const std::vector<std::pair<std::string, ItemKind>> names = {
      {"map", ItemKind::map},
      {"scene", ItemKind::scene},
      {"picture", ItemKind::picture},
      {"chart", ItemKind::picture},
      {"table", ItemKind::table},
      {"values", ItemKind::values},
      {"parameters", ItemKind::parameters},
      {"timings", ItemKind::timings},
      {"listing", ItemKind::listing},
      {"note", ItemKind::note}};
  return names;
}

Outline parse_outline(const std::string& yaml, const std::string& file) {
  Outline outline;
  read_yaml(yaml, file, [&](const YAML::Node& root) {
    Keys keys(root, "outline");
    outline.title = keys.required_text("title");
    outline.text = keys.text("text");
    keys.each("items", [&](const auto& entry) { outline.items.push_back(parse_item(entry)); });
    keys.each("sections",
              [&](const auto& entry) { outline.sections.push_back(parse_section(entry, 1)); });
    keys.end();
  });
  return outline;
}

Outline read_outline(const std::filesystem::path& path) {
  return parse_outline(read_whole_file(path, std::uint64_t{1} << 22), path.string());
}

}  // namespace libmap

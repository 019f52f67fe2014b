#include "libmap/core/yaml_document.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "libmap/core/text.h"

namespace libmap {

namespace {

// A node of yaml-cpp takes about 250 bytes of memory, but only two bytes of the file.
constexpr std::size_t max_nodes = 500'000;

// Counts nodes without storing them. An alias counts as all nodes that it refers to, because a
// reader visits them each time.
class NodeCount : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override { sizes_.clear(); }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t anchor) override { leaf(anchor); }
  void OnAlias(const YAML::Mark&, YAML::anchor_t anchor) override { add(sizes_[anchor]); }
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t anchor,
                const std::string&) override {
    leaf(anchor);
  }
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(anchor);
  }
  void OnMapEnd() override { close(); }

 private:
  void add(std::size_t nodes) {
    count_ += nodes;
    if (count_ > max_nodes) throw Error("contains more than 500000 values");
  }
  void leaf(YAML::anchor_t anchor) {
    add(1);
    sizes_[anchor] = 1;
  }
  void open(YAML::anchor_t anchor) {
    open_.emplace_back(anchor, count_);
    // An alias inside its own anchor: yaml-cpp makes a cycle, which a reader would follow forever.
    sizes_[anchor] = max_nodes;
    add(1);
  }
  void close() {
    sizes_[open_.back().first] = count_ - open_.back().second;
    open_.pop_back();
  }

  std::size_t count_ = 0;
  std::map<YAML::anchor_t, std::size_t> sizes_;
  std::vector<std::pair<YAML::anchor_t, std::size_t>> open_;  // anchors, and the count before
};

// YAML::LoadAll would allocate memory without limit if text outside a document follows: "[a], b".
bool has_second_document(const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  NodeCount events;
  return parser.HandleNextDocument(events) && parser.HandleNextDocument(events);
}

}  // namespace

void read_yaml(const std::string& text, const std::string& file,
               const std::function<void(const YAML::Node&)>& read) {
  try {
    if (has_second_document(text)) throw Error("contains more than one YAML document");
    read(YAML::Load(text));
  } catch (const YAML::Exception& error) {
    const std::string position =
        error.mark.is_null() ? "" : "line " + std::to_string(error.mark.line + 1);
    throw Error("not valid YAML: " + error.msg, {.file = file, .field = position});
  } catch (const Error& error) {
    throw error.in_file(file);
  }
}

Error unknown_key(std::string_view key, const std::vector<std::string>& known,
                  const std::string& whose) {
  return Error("unknown key" + whose + did_you_mean(key, known), {.field = std::string(key)});
}

void check_keys(const YAML::Node& map, const std::vector<std::string>& known,
                const std::string& whose) {
  std::set<std::string> seen;
  for (const auto& entry : map) {
    if (!entry.first.IsScalar()) throw Error("not a name", {.field = "key of a mapping"});
    const std::string& key = entry.first.Scalar();
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw unknown_key(key, known, whose);
    if (!seen.insert(key).second) throw Error("occurs twice", {.field = key});
  }
}

Error at_node(const Error& error, const std::string& position, const YAML::Node& node) {
  ErrorContext context = error.in_field(position, ".").context();
  if (!node.Mark().is_null())
    context.field += " (line " + std::to_string(node.Mark().line + 1) + ")";
  return Error(error.reason(), context);
}

}  // namespace libmap

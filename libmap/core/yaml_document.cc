#include "libmap/core/yaml_document.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <sstream>

#include "libmap/core/error.h"

namespace libmap {

namespace {

// A node of yaml-cpp takes some 250 bytes, a comma and a letter of the file two.
constexpr std::size_t max_nodes = 500'000;

// Counts nodes, and keeps none.
class NodeCount : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override { add(); }
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override { add(); }
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {
    add();
  }
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    add();
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    add();
  }
  void OnMapEnd() override {}

 private:
  void add() {
    if (++count_ > max_nodes) throw Error("holds more than 500000 values");
  }
  std::size_t count_ = 0;
};

// YAML::LoadAll would take memory without end where something stands that belongs to no document:
// "[a], b".
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
    if (has_second_document(text)) throw Error("holds more than one YAML document");
    read(YAML::Load(text));
  } catch (const YAML::Exception& error) {
    const std::string place =
        error.mark.is_null() ? "" : "line " + std::to_string(error.mark.line + 1);
    throw Error("not valid YAML: " + error.msg, {.file = file, .field = place});
  } catch (const Error& error) {
    throw error.in_file(file);
  }
}

}  // namespace libmap

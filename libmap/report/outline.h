// What a report shows, as plain data: sections, and what stands in each. README.md has the format
// of the files that outline_io.h reads.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace libmap {

// What an item of a report shows.
enum class ItemKind { picture, table, map, scene, parameters, values, timings, listing, note };
const std::vector<std::pair<std::string, ItemKind>>& item_kind_names();

struct OutlineColumn {
  std::string name{};     // in the CSV file
  std::string heading{};  // in the report
};

// One figure out of a JSON file.
struct OutlineValue {
  std::string label{};
  std::string file{};
  std::string at{};  // JSON pointer (RFC 6901)
  std::string unit{};
  std::string published{};
};

// The outputs whose running times make one column.
struct OutlineCase {
  std::string name{};
  std::string folder{};              // all manifests below it, or
  std::vector<std::string> files{};  // those of these outputs
};

// Running times of a CSV file in microseconds, beside our own.
struct OutlinePublishedTimes {
  std::string file{};
  std::string name_column{};                                   // empty: the first
  std::vector<std::pair<std::string, std::string>> columns{};  // its column, our heading
  std::vector<std::pair<std::string, std::string>> rows{};     // our step, its name
};

// Paths are relative to the folder of the section; one that begins with "$GRASPMAP_DATA/" to that
// variable's.
struct OutlineItem {
  ItemKind kind = ItemKind::note;
  std::vector<std::string> files{};
  std::vector<std::string> labels{};  // none, or one a file
  std::string caption{};
  std::vector<OutlineColumn> columns{};  // none: all
  std::size_t rows = 40;                 // of a table that are not folded away
  std::string lookup{};                  // of a map: looked-up points
  std::string verdict{};                 // of a map: their column of 1, 0 or nothing
  std::string picture{};                 // of a map: what is shown where no 3-D view can be
  std::vector<OutlineValue> values{};
  std::vector<OutlineCase> cases{};
  std::vector<std::string> commands{};  // of timings: of these alone
  OutlinePublishedTimes published{};
  std::string text{};  // of a note
};

struct OutlineSection {
  std::string heading{};
  std::string folder{};  // relative to that of the section around it
  std::string text{};
  std::string required_file{};  // without it the section is not shown
  std::vector<OutlineItem> items{};
  std::vector<OutlineSection> sections{};
};

struct Outline {
  std::string title{};
  std::string text{};
  std::vector<OutlineItem> items{};  // before the first section
  std::vector<OutlineSection> sections{};
};

}  // namespace libmap

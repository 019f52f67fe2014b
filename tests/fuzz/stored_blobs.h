// Small scan database in which single blobs can be replaced.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tests/fuzz/scratch_file.h"

namespace graspmap_fuzz {

class StoredBlobs {
 public:
  StoredBlobs();

  // Number of blobs in the database.
  std::size_t places() const { return places_.size(); }
  const std::string& blob(std::size_t place) const { return places_[place].bytes; }

  // Returns the path of the database with one blob replaced; each call overwrites the same file.
  const std::filesystem::path& database_with(std::size_t place, std::string_view bytes) const;

 private:
  struct Place {
    std::string table;
    std::string column;
    std::int64_t row = 0;
    std::string bytes;
  };

  ScratchFile file_{"blob.db"};
  std::string sample_;  // bytes of the unchanged database
  std::vector<Place> places_;
};

}  // namespace graspmap_fuzz

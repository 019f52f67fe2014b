// Folders that appear whole or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace libmap {

// One output folder in the making. Write into temporary_path(), which lies beside the final one;
// commit() syncs it and puts it in place of the final one, whose earlier content is then gone.
// Without a commit the temporary is removed and an earlier folder stays as it was. While it lives,
// a second process that wants to write the same folder gets an Error.
class OutputFolder {
 public:
  // `names` are those that the folder may hold: an earlier one that holds any other is not
  // replaced. Throws Error: something else than a folder is there, one with foreign content, or it
  // cannot be written.
  OutputFolder(std::filesystem::path final_path, const std::vector<std::string>& names);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  void commit();  // throws Error (failed) if the folder cannot be synced or put in place

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
  int lock_ = -1;
};

}  // namespace libmap

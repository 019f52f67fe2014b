// One run of a command: its messages, its timings and its outputs. Files of commands have from here
// what nearly each of them needs of the standard library, fmt and libmap/core.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/progress.h"
#include "libmap/core/text.h"

namespace graspmap_tools {

using libmap::in_file;

// For a terminal, of a text that may come from a file: one line of printable UTF-8. Control
// characters and bytes that are no UTF-8 become \xNN, line breaks spaces; the middle of a long text
// is left out.
std::string message_text(const std::string& text);

// "maps/" and "maps" name the same folder, and its manifest stands beside it.
std::string without_trailing_slash(std::string path);

struct RunOptions {
  bool dry_run = false;
  bool force = false;
  bool quiet = false;
  bool verbose = false;
  unsigned threads = 0;
};

class Run {
 public:
  Run(std::string command, RunOptions options, libmap::Progress& progress);

  const RunOptions& options() const { return options_; }
  libmap::Progress& progress() { return progress_; }
  libmap::Manifest& manifest() { return manifest_; }

  void add_results(const libmap::ResultTable& table) { manifest_.add_results(table); }

  // Hashes an input into the manifest, of a folder each file; the toolkit's own data by its place
  // among them, so that the manifest does not depend on where the toolkit lies.
  void add_input(const std::filesystem::path& path);

  // To stderr: unless --quiet; always; with --verbose only.
  void say(const std::string& text);
  void warn(const std::string& text);
  void detail(const std::string& text);
  template <typename... Values>
  void say(fmt::format_string<Values...> text, Values&&... values) {
    say(fmt::format(text, std::forward<Values>(values)...));
  }
  template <typename... Values>
  void warn(fmt::format_string<Values...> text, Values&&... values) {
    warn(fmt::format(text, std::forward<Values>(values)...));
  }
  template <typename... Values>
  void detail(fmt::format_string<Values...> text, Values&&... values) {
    detail(fmt::format(text, std::forward<Values>(values)...));
  }

  // Runs `step` and keeps its wall time in the manifest.
  template <typename Step>
  auto timed(const std::string& name, const Step& step) {
    const Timing timing(*this, name);
    return step();
  }
  // What a stage has timed itself, as "STAGE: STEP"; shown with --verbose.
  void add_timings(const std::vector<std::pair<std::string, double>>& timings_s,
                   const std::string& stage = {});

  // Throws Error if `path` is one of the inputs, if it exists and this toolkit did not write it,
  // unless --force, if it cannot be written, or if another process has claimed it. Call it before
  // the work: from here to the end of this run the output is this process's alone.
  void claim_output(const std::filesystem::path& path, const std::vector<std::string>& inputs = {});

  // writer(temporary) writes the file; it is put in place whole, with its manifest beside it. With
  // --dry-run nothing is written.
  using Writer = std::function<void(const std::filesystem::path& temporary)>;
  static Writer text_writer(std::string text);
  void write_output(const std::filesystem::path& path, const Writer& writer);
  void write_text(const std::filesystem::path& path, const std::string& text);

  // The same of an output in several files, `path` the last of them: all are written before the
  // first is put in place, in their order, so that where `path` is the others are. These must not
  // stand there already unless an earlier run of this command wrote `path`, or --force:
  // require_own_companions throws Error if one does, and may be called before the work.
  void require_own_companions(const std::filesystem::path& path,
                              const std::vector<std::filesystem::path>& others);
  using Files = std::vector<std::pair<std::filesystem::path, Writer>>;
  void write_outputs(const std::filesystem::path& path, const Files& files);

  // A folder of outputs, made if it is missing, claimed as a file is. All files are written before
  // the first is put in place; the manifest FOLDER.json stands beside the folder. With --dry-run
  // nothing is written.
  void claim_output_folder(const std::filesystem::path& folder);
  void write_output_folder(const std::filesystem::path& folder, const Files& files);

  // A folder of any number of files: writer(temporary) fills a folder beside it, which then takes
  // the place of `folder` as a whole. An earlier one that holds anything but `names`, or is one of
  // the inputs, is an Error, with --force too. With --dry-run the writer gets no folder (an empty
  // path) and nothing is written. check_output_tree throws as claim_output_tree but for `names`,
  // and claims nothing: for folders that several runs make together.
  void check_output_tree(const std::filesystem::path& folder,
                         const std::vector<std::string>& inputs = {});
  void claim_output_tree(const std::filesystem::path& folder, const std::vector<std::string>& names,
                         const std::vector<std::string>& inputs = {});
  void write_output_tree(const std::filesystem::path& folder, const std::vector<std::string>& names,
                         const Writer& writer);

 private:
  struct Timing {
    Timing(Run& timed_run, std::string step) : run(timed_run), name(std::move(step)) {}
    ~Timing();
    Timing(const Timing&) = delete;
    Timing& operator=(const Timing&) = delete;

    Run& run;
    std::string name;
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  };

  // What stands in a folder must be of an earlier run of this command; `remedy` ends the message.
  void require_own_folder(const std::filesystem::path& folder, const std::string& remedy);
  // An output is claimed by its manifest, which is in the making from the claim on; begin_manifest
  // takes it to write it, and makes it where nothing was claimed.
  void claim_manifest(const std::filesystem::path& output);
  libmap::OutputFile begin_manifest(const std::filesystem::path& output);
  // Writes the files and the manifest, then puts them in place.
  void write_together(const std::filesystem::path& output, const Files& files, bool is_timed);

  std::string command_;
  RunOptions options_;
  libmap::Progress& progress_;
  libmap::Manifest manifest_;
  std::map<std::string, libmap::OutputFile> claimed_manifests_;  // by the output's path
};

}  // namespace graspmap_tools

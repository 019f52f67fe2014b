// One run of a command: messages, timings, and outputs with manifests (OUTPUT.json). Also includes
// the headers of the standard library, fmt and libmap/core that nearly all commands need.
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

// Converts any text to one line of printable UTF-8 for a terminal: control characters and invalid
// bytes become \xNN, line breaks become spaces, the middle of a long text is left out.
std::string sanitize_text(const std::string& text);

// Removes trailing slashes: "maps/" and "maps" are the same folder with the same manifest.
std::string without_trailing_slash(std::string path);

// Values of the flags that all commands have.
struct RunOptions {
  bool dry_run = false;
  bool force = false;
  bool quiet = false;
  bool verbose = false;
  unsigned threads = 0;  // number of threads, for the manifest
};

class Run {
 public:
  Run(std::string command, RunOptions options, libmap::Progress& progress);

  const RunOptions& options() const { return options_; }
  libmap::Progress& progress() { return progress_; }
  libmap::Manifest& manifest() { return manifest_; }

  void add_results(const libmap::ResultTable& table) { manifest_.add_results(table); }

  // Adds an input with its hash to the manifest; for a folder, each file directly in the folder.
  // Paths in the toolkit's data folder become relative, independent of the installation.
  void add_input(const std::filesystem::path& path);

  // Print to stderr: `info` without --quiet, `warn` always, `detail` with --verbose.
  void info(const std::string& text);
  void warn(const std::string& text);
  void detail(const std::string& text);
  template <typename... Values>
  void info(fmt::format_string<Values...> text, Values&&... values) {
    info(fmt::format(text, std::forward<Values>(values)...));
  }
  template <typename... Values>
  void warn(fmt::format_string<Values...> text, Values&&... values) {
    warn(fmt::format(text, std::forward<Values>(values)...));
  }
  template <typename... Values>
  void detail(fmt::format_string<Values...> text, Values&&... values) {
    detail(fmt::format(text, std::forward<Values>(values)...));
  }

  // Runs `step`, adds its wall time to the manifest, and returns its result.
  template <typename Step>
  auto timed(const std::string& name, const Step& step) {
    const Timing timing(*this, name);
    return step();
  }
  // Adds the times of a stage's steps to the manifest as "STAGE: STEP"; --verbose prints them.
  void add_timings(const std::vector<std::pair<std::string, double>>& timings_s,
                   const std::string& stage = {});

  // Claims (reserves) the output for this process until the end of the run; call it before the
  // work. Throws Error if `path` is one of the inputs, is claimed by another process, cannot be
  // written, or, unless --force, exists and was not written by this toolkit.
  void claim_output(const std::filesystem::path& path, const std::vector<std::string>& inputs = {});

  // Calls writer(temporary), which writes a temporary file, then moves this file to `path` together
  // with the manifest. With --dry-run, writes nothing.
  using Writer = std::function<void(const std::filesystem::path& temporary)>;
  static Writer text_writer(std::string text);
  void write_output(const std::filesystem::path& path, const Writer& writer);
  void write_text(const std::filesystem::path& path, const std::string& text);

  // write_outputs writes an output of several files, of which `path` is the last. All are complete
  // before they are moved in order, so that all others exist if `path` does. It first calls
  // require_own_companions, which throws Error if one of the others exists and no earlier run of
  // this command wrote `path` (unless --force).
  void require_own_companions(const std::filesystem::path& path,
                              const std::vector<std::filesystem::path>& others);
  using Files = std::vector<std::pair<std::filesystem::path, Writer>>;
  void write_outputs(const std::filesystem::path& path, const Files& files);

  // Claim and write a folder of outputs, which is created if it is missing and may contain other
  // files of this command. All files are complete before the first is moved into the folder. The
  // manifest is FOLDER.json. With --dry-run, nothing is written.
  void claim_output_folder(const std::filesystem::path& folder);
  void write_output_folder(const std::filesystem::path& folder, const Files& files);

  // Claim and write a folder that replaces an earlier `folder` as a whole; writer(temporary) fills
  // a temporary folder. Throw Error, even with --force, if `folder` contains other files than
  // `names` or is one of the inputs. With --dry-run, writes nothing and calls writer({}).
  // check_output_tree makes all checks except that of `names`, and claims nothing.
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

  // Throws Error if the folder contains files that this command did not write; `remedy` is appended
  // to the message.
  void require_own_folder(const std::filesystem::path& folder, const std::string& remedy);
  // claim_manifest claims an output by creating a temporary manifest. begin_manifest returns the
  // temporary manifest for writing, and creates it if the output was not claimed.
  void claim_manifest(const std::filesystem::path& output);
  libmap::OutputFile begin_manifest(const std::filesystem::path& output);
  // Writes the files and the manifest, then moves all to the final paths.
  void write_together(const std::filesystem::path& output, const Files& files, bool is_timed);

  std::string command_;
  RunOptions options_;
  libmap::Progress& progress_;
  libmap::Manifest manifest_;
  std::map<std::string, libmap::OutputFile> claimed_manifests_;  // by the output's path
};

}  // namespace graspmap_tools

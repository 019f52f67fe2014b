#include "tools/support/command_line.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "libmap/core/parallel.h"
#include "tools/support/commands.h"
#include "tools/support/process_end.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

constexpr int exit_failed = 1;
constexpr int exit_usage = 2;
constexpr int exit_bad_input = 3;

void start_log(const std::string& command, const RunOptions& options) {
  auto logger = spdlog::stderr_color_st("graspmap " + command);
  logger->set_pattern("%n: %^%l%$: %v");
  logger->set_level(options.quiet     ? spdlog::level::warn
                    : options.verbose ? spdlog::level::debug
                                      : spdlog::level::info);
  spdlog::set_default_logger(logger);
}

int report(const std::string& command, const std::string& message, int exit_code) {
  exit_if_signaled();
  std::cerr << "graspmap " << command << ": error: " << sanitize_text(message) << "\n";
  return exit_code;
}

std::string unit_of(const libmap::Parameter& parameter) {
  if (parameter.type == libmap::ParameterType::text) {
    std::string names;
    for (const std::string& choice : parameter.choices)
      names += (names.empty() ? "" : "|") + choice;
    return names.empty() ? "TEXT" : names;
  }
  const std::string_view key = parameter.key;
  for (const auto& [suffix, name] : {std::pair{"_mm", "MM"},
                                     {"_m", "M"},
                                     {"_deg", "DEG"},
                                     {"_px", "PX"},
                                     {"_s", "S"},
                                     {"_n", "N"}})
    if (key.ends_with(suffix)) return name;
  return parameter.type == libmap::ParameterType::integer ? "N" : "X";
}

std::string sentence(std::string_view summary) {
  std::string text(summary);
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(text[0]));
  return text + ".";
}

// Minimum elapsed time for an estimate of the remaining time.
constexpr double min_elapsed_s = 2.0;

// Counts steps and shows each whole percent once, with the remaining time.
class Counting : public libmap::Progress {
 public:
  void begin(std::string_view stage, std::size_t total) override {
    end();
    const std::lock_guard lock(mutex_);
    stage_ = stage;
    total_ = total;
    done_ = 0;
    begin_ = Clock::now();
    shown_percent_ = -1;
    show_if_new();
  }
  void advance(std::size_t steps) override {
    const std::lock_guard lock(mutex_);
    done_ += steps;
    show_if_new();
  }
  void end() override {
    const std::lock_guard lock(mutex_);
    if (!stage_.empty()) finish();
    stage_.clear();
  }

 protected:
  using SecondsLeft = std::optional<long>;
  virtual void show(const std::string& stage, std::size_t done, std::size_t total,
                    SecondsLeft left) = 0;
  virtual void finish() {}

 private:
  using Clock = std::chrono::steady_clock;

  SecondsLeft left() const {
    const double elapsed = std::chrono::duration<double>(Clock::now() - begin_).count();
    if (done_ == 0 || total_ < done_ || elapsed < min_elapsed_s) return std::nullopt;
    return std::lround(elapsed * static_cast<double>(total_ - done_) / static_cast<double>(done_));
  }
  void show_if_new() {
    const int percent = total_ == 0 ? 0 : static_cast<int>(done_ * 100 / total_);
    if (percent == shown_percent_) return;
    shown_percent_ = percent;
    show(stage_, done_, total_, left());
  }

  std::mutex mutex_;
  std::string stage_;
  std::size_t total_ = 0;
  std::size_t done_ = 0;
  Clock::time_point begin_;
  int shown_percent_ = -1;
};

class Bar : public Counting {
 public:
  ~Bar() override { end(); }

 private:
  void show(const std::string& stage, std::size_t done, std::size_t total,
            SecondsLeft left) override {
    constexpr std::size_t width = 30;
    if (total == 0) return fmt::print(stderr, "\r{:<24} ...\033[K", stage);
    const std::size_t filled = total == 0 ? 0 : done * width / total;
    fmt::print(stderr, "\r{:<24} [{:#<{}}{:.<{}}] {}/{}{}\033[K ", stage, "", filled, "",
               width - filled, done, total,
               left ? fmt::format(", {}:{:02} left", *left / 60, *left % 60) : "");
  }
  void finish() override { fmt::print(stderr, "\r\033[K"); }
};

class JsonLines : public Counting {
  void show(const std::string& stage, std::size_t done, std::size_t total,
            SecondsLeft left) override {
    nlohmann::ordered_json line = {{"stage", stage}, {"done", done}, {"total", total}};
    if (left) line["left_s"] = *left;
    fmt::print(stderr, "{}\n", line.dump());
  }
};

// Returns the progress display of a style; nullptr for "none". "auto": a bar if stderr is a
// terminal, else nullptr; "json": one JSON line per percent. Throws Error for another style.
std::unique_ptr<libmap::Progress> make_progress(const std::string& style) {
  if (style == "json") return std::make_unique<JsonLines>();
  if (style == "auto" && isatty(STDERR_FILENO) == 1) return std::make_unique<Bar>();
  if (style == "auto" || style == "none") return nullptr;
  throw libmap::Error("not a style of progress display",
                      {.field = "--progress", .value = style, .bound = "one of auto, json, none"});
}

}  // namespace

void reject_given(const std::vector<std::pair<const char*, bool>>& flags,
                  const std::string& reason) {
  for (const auto& [flag, is_given] : flags)
    if (is_given) throw libmap::Error(reason, {.field = flag});
}

struct Command::Parts {
  Parts(std::string command_name, const std::string& summary)
      : name(std::move(command_name)), app(summary, "graspmap " + name) {}

  std::string name;
  CLI::App app;
  libmap::ParameterTable table;
  std::function<fs::path(const std::string&)> config_resolver;
  std::string preset_key;  // empty: there is none
  std::function<fs::path(const std::string&)> preset_resolver;

  RunOptions run_options;
  std::string config;
  std::string threads = "0";
  std::string progress = "auto";
  bool print_config = false;
  CLI::Option* output_option = nullptr;
  std::vector<std::string> overrides;                            // --set
  std::vector<std::pair<std::string, std::string>> flag_values;  // key, text
  std::vector<std::pair<std::string, std::string>> configured;   // key, text from --config

  fs::path config_file() const {
    return config_resolver ? config_resolver(config) : fs::path(config);
  }
  void add_common_options();
  void add_parameter_flags();
  void apply_parameters();
  void apply_preset();
  std::optional<fs::path> preset_file() const;
  libmap::Error placed(const libmap::Error& error) const;
  // Returns the exit code if the command is complete, for example after --help.
  std::optional<int> parse(int argc, char** argv);
  void work(const std::function<void(Run&)>& body);
  std::map<std::string, std::string> former_flags;
  std::map<std::string, std::string> renamed_flags;  // flag by its earlier name
  std::vector<std::string> with_current_flags(int argc, char** argv) const;
  std::optional<std::string> unknown_flag(int argc, char** argv) const;
  int usage_error(const std::string& message) const;
};

Command::Command(const std::string& name, const std::string& description)
    : parts_(std::make_unique<Parts>(
          name, description.empty() ? sentence(summary_of(name)) : description)) {}
Command::~Command() = default;

void Command::input(const std::string& name, std::string& path, const std::string& description) {
  parts_->app.add_option(name, path, description)->required()->type_name("");
}

void Command::inputs(const std::string& name, std::vector<std::string>& paths,
                     const std::string& description) {
  parts_->app.add_option(name, paths, description)->required()->type_name("");
}

void Command::output(std::string& path, const std::string& description, bool required) {
  parts_->output_option = parts_->app.add_option("-o,--output", path, description)
                              ->type_name("OUTPUT")
                              ->required(required);
}

void Command::former_flag(const std::string& name, const std::string& now) {
  parts_->former_flags[name] = now;
}

void Command::renamed_flag(const std::string& earlier, const std::string& now) {
  parts_->renamed_flags[earlier] = now;
}

void Command::flag(const std::string& name, bool& value, const std::string& description) {
  parts_->app.add_flag(name, value, description);
}

void Command::option(const std::string& name, const std::string& value_name, std::string& value,
                     const std::string& description, bool required) {
  parts_->app.add_option(name, value, description)
      ->type_name(value_name)
      ->capture_default_str()
      ->required(required);
}

void Command::option(const std::string& name, const std::string& value_name,
                     std::vector<std::string>& values, const std::string& description) {
  parts_->app.add_option(name, values, description)->type_name(value_name)->delimiter(',');
}

libmap::ParameterTable& Command::parameters() { return parts_->table; }

void Command::config_resolver(std::function<fs::path(const std::string&)> resolver) {
  parts_->config_resolver = std::move(resolver);
}

void Command::preset(const std::string& key, std::function<fs::path(const std::string&)> resolver) {
  parts_->preset_key = key;
  parts_->preset_resolver = std::move(resolver);
}

void Command::Parts::add_common_options() {
  if (!table.parameters().empty()) {
    app.add_option("--config", config, "YAML file with values of parameters; flags take precedence")
        ->type_name("FILE.yaml");
    app.add_option("--set", overrides,
                   "value of one parameter; KEY as in --print-config; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_flag("--print-config", print_config, "print the effective parameters as YAML and exit");
  }
  app.add_flag("--dry-run", run_options.dry_run, "check inputs and parameters, and write nothing");
  app.add_flag("--force", run_options.force, "overwrite outputs that graspmap did not write");
  app.add_option("--threads", threads, "number of threads; 0: all processors")->type_name("N");
  app.add_option("--progress", progress, "progress display: auto, json, none")->type_name("STYLE");
  app.add_flag("--quiet", run_options.quiet, "print warnings and errors only");
  app.add_flag("--verbose", run_options.verbose, "also print the computing time of each step");
}

void Command::Parts::add_parameter_flags() {
  for (const libmap::Parameter& parameter : table.parameters()) {
    const std::string flag = libmap::flag_of(parameter.key);
    const auto keep = [this, key = parameter.key](const std::string& text) {
      flag_values.emplace_back(key, text);
    };
    const std::string description = parameter.description + " [" + parameter.get() + "]";
    if (parameter.type == libmap::ParameterType::boolean) {
      app.add_flag_function(
             flag + ",!--no-" + flag.substr(2),
             [keep](std::int64_t count) { keep(count > 0 ? "true" : "false"); }, description)
          ->group("Parameters");
    } else {
      app.add_option_function<std::string>(flag, keep, description)
          ->type_name(unit_of(parameter))
          ->group("Parameters");
    }
  }
}

void Command::Parts::apply_parameters() {
  if (!config.empty()) {
    const fs::path path = config_file();
    const auto before = table.values();
    libmap::set_from_yaml(table, libmap::read_whole_file(path, 1U << 24U), path.string());
    for (const auto& value : table.values())
      if (std::find(before.begin(), before.end(), value) == before.end())
        configured.push_back(value);
  }
  for (const auto& [key, text] : flag_values) {
    try {
      table.set(key, text);
    } catch (const libmap::Error& error) {
      libmap::ErrorContext context = error.context();
      context.field = libmap::flag_of(key);
      throw libmap::Error(error.reason(), context);
    }
  }
  for (const std::string& override : overrides) {
    const std::size_t equals = override.find('=');
    if (equals == std::string::npos)
      throw libmap::Error("contains no '='",
                          {.field = "--set", .value = override, .bound = "KEY=VALUE"});
    table.set(override.substr(0, equals), override.substr(equals + 1));
  }
}

std::optional<fs::path> Command::Parts::preset_file() const {
  const libmap::Parameter* parameter = table.find(preset_key);
  if (parameter == nullptr || parameter->get() == "auto") return std::nullopt;
  return preset_resolver(parameter->get());
}

// Reads the preset, then applies --config and the flags again, which take precedence.
void Command::Parts::apply_preset() {
  const std::optional<fs::path> path = preset_file();
  if (!path) return;
  libmap::set_from_yaml(table, libmap::read_whole_file(*path, 1U << 24U), path->string());
  configured.clear();
  apply_parameters();
}

// Adds the file of --config to an error about a value from that file.
libmap::Error Command::Parts::placed(const libmap::Error& error) const {
  const libmap::Parameter* parameter = table.find(error.context().field);
  if (parameter == nullptr) return error;
  const bool is_configured =
      std::find(configured.begin(), configured.end(),
                std::pair(parameter->key, parameter->get())) != configured.end();
  return is_configured ? error.in_file(config_file().string()) : error;
}

// Returns the arguments with earlier names of flags replaced, up to "--".
std::vector<std::string> Command::Parts::with_current_flags(int argc, char** argv) const {
  std::map<std::string, std::string> renamed_flags = this->renamed_flags;
  for (const auto& [earlier, now] : table.former_keys()) {
    const std::string was = libmap::flag_of(earlier);
    const std::string is = libmap::flag_of(now);
    renamed_flags[was] = is;
    renamed_flags["--no-" + was.substr(2)] = "--no-" + is.substr(2);
  }
  std::vector<std::string> words(argv, argv + argc);
  for (std::string& word : words) {
    if (word == "--") break;
    const std::size_t end = std::min(word.find('='), word.size());
    if (const auto renamed = renamed_flags.find(word.substr(0, end));
        renamed != renamed_flags.end())
      word.replace(0, end, renamed->second);
  }
  return words;
}

// Returns an error text for the first unknown or former long flag. CLI11 alone would report missing
// arguments first.
std::optional<std::string> Command::Parts::unknown_flag(int argc, char** argv) const {
  std::vector<std::string> flags;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& flag : option->get_lnames()) flags.push_back("--" + flag);
  for (int n = 1; n < argc; ++n) {
    const std::string word = argv[n];
    if (word == "--") break;
    const std::string flag = word.substr(0, word.find('='));
    if (const auto former = former_flags.find(flag); former != former_flags.end())
      return flag + " is now " + former->second;
    if (flag.starts_with("--") && std::find(flags.begin(), flags.end(), flag) == flags.end())
      return "unknown flag " + flag + libmap::did_you_mean(flag, flags);
  }
  return std::nullopt;
}

int Command::Parts::usage_error(const std::string& message) const {
  return report(name, message + "; graspmap " + name + " --help shows the usage", exit_usage);
}

std::optional<int> Command::Parts::parse(int argc, char** argv) {
  add_parameter_flags();
  add_common_options();
  // --print-config needs no inputs.
  const auto asks_for_config = [&] {
    return std::any_of(argv, argv + argc,
                       [](const char* word) { return std::string(word) == "--print-config"; });
  };
  if (!table.parameters().empty() && asks_for_config())
    for (CLI::Option* option : app.get_options()) option->required(false);
  if (const auto message = unknown_flag(argc, argv)) return usage_error(*message);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::cout << app.help();
    require_printed();
    return 0;
  } catch (const CLI::ParseError& error) {
    // CLI11's message does not name the surplus argument.
    const std::vector<std::string> surplus = app.remaining();
    const bool too_many = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
    return usage_error(too_many && !surplus.empty() ? "one argument too many: " + surplus.front()
                                                    : error.what());
  }
  apply_parameters();
  apply_preset();
  if (!print_config) return std::nullopt;
  std::cout << libmap::to_yaml(table);
  require_printed();
  return 0;
}

void Command::Parts::work(const std::function<void(Run&)>& body) {
  const auto given = libmap::parse_integer(threads);
  if (!given || *given < 0 || *given > 4096)
    throw libmap::Error("not a number of threads",
                        {.field = "--threads", .value = threads, .bound = ">= 0 and <= 4096"});
  run_options.threads =
      *given == 0 ? std::thread::hardware_concurrency() : static_cast<unsigned>(*given);
  const libmap::ThreadLimit limit(run_options.threads);
  end_cleanly_on_signals();
  start_log(name, run_options);
  const std::unique_ptr<libmap::Progress> bar =
      make_progress(run_options.quiet ? "none" : progress);
  Run run(name, run_options, bar ? *bar : libmap::no_progress());
  run.manifest().add_parameters(table);
  if (!config.empty()) run.add_input(config_file());
  if (const auto preset = preset_file()) run.add_input(*preset);
  body(run);
  run.progress().end();
  require_printed();
  exit_if_signaled();
}

int Command::run(int argc, char** argv, const std::function<void(Run&)>& body) {
  const std::string& name = parts_->name;
  try {
    std::vector<std::string> words = parts_->with_current_flags(argc, argv);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    if (const auto exit_code = parts_->parse(argc, arguments.data())) return *exit_code;
    parts_->work(body);
    return 0;
  } catch (const UsageError& error) {
    return parts_->usage_error(error.what());
  } catch (const libmap::Error& error) {
    return report(name, parts_->placed(error).what(),
                  error.kind() == libmap::ErrorKind::bad_input ? exit_bad_input : exit_failed);
  } catch (const fs::filesystem_error& error) {
    // Invalid paths, such as a link to itself, are bad input; other errors are failures.
    const bool is_path = error.code() == std::errc::too_many_symbolic_link_levels ||
                         error.code() == std::errc::filename_too_long ||
                         error.code() == std::errc::permission_denied ||
                         error.code() == std::errc::not_a_directory;
    return report(name, error.path1().string() + ": " + error.code().message(),
                  is_path ? exit_bad_input : exit_failed);
  } catch (const std::bad_alloc&) {
    return report(name, "out of memory", exit_failed);
  } catch (const std::exception& error) {
    return report(name, error.what(), exit_failed);
  }
}

int run_subcommand(int argc, char** argv, std::initializer_list<Subcommand*> subcommands,
                   Subcommand* chosen) {
  int exit_code = chosen(argc, argv);
  const bool asks_for_help = std::any_of(
      argv, argv + argc, [](const std::string& word) { return word == "--help" || word == "-h"; });
  if (!asks_for_help || chosen != *subcommands.begin()) return exit_code;
  for (Subcommand* const other : subcommands) {
    if (other == chosen || exit_code != 0) continue;
    std::cout << "\n";
    exit_code = other(argc, argv);
  }
  return exit_code;
}

}  // namespace graspmap_tools

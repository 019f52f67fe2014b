// Parses the command line of a command (inputs, output, one flag per parameter, --config,
// --print-config, --dry-run), runs the command, and reports errors in one line and by exit code.
//
//   int main(int argc, char** argv) {
//     ScoreOptions options;
//     Command command("score");
//     command.input("TERRAIN", options.terrain, "cloud of the terrain");
//     command.output(options.map, "graspability map (.pcd, .ply, .vtp, .csv)");
//     bind(command.parameters(), options);
//     return command.run(argc, argv, [&](Run& run) { score(options, run); });
//   }
#pragma once

#include "tools/support/run.h"

namespace graspmap_tools {

// Error of wrong usage, found before any file is read: exit code 2.
class UsageError : public libmap::Error {
 public:
  using Error::Error;
};

// Throws Error with `reason` and the flag of the first parameter of `bind` with a changed value.
template <typename Options>
void reject_changed(const Options& options, void (*bind)(libmap::ParameterTable&, Options&),
                    const std::string& reason) {
  if (const auto key = libmap::changed_key(options, bind))
    throw libmap::Error(reason, {.field = libmap::flag_of(*key)});
}
// Throws Error with `reason` and the first flag that the user gave (value true).
void reject_given(const std::vector<std::pair<const char*, bool>>& flags,
                  const std::string& reason);

class Command {
 public:
  // An empty description means the summary in commands.h.
  explicit Command(const std::string& name, const std::string& description = {});
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  // Positional arguments, in the order of the calls.
  void input(const std::string& name, std::string& path, const std::string& description);
  void inputs(const std::string& name, std::vector<std::string>& paths,
              const std::string& description);
  // -o, --output.
  void output(std::string& path, const std::string& description, bool required = true);
  // Flags and options that are not parameters of a stage, such as --json or --tile.
  void flag(const std::string& name, bool& value, const std::string& description);
  void option(const std::string& name, const std::string& value_name, std::string& value,
              const std::string& description, bool required = false);
  // Declares a flag of earlier versions. Its use is an error, which names the flag `now`.
  void former_flag(const std::string& name, const std::string& now);
  // Declares the earlier name of a flag, which is still read, but not shown by --help.
  void renamed_flag(const std::string& earlier, const std::string& now);
  // An option with any number of values: repeated, or separated by commas.
  void option(const std::string& name, const std::string& value_name,
              std::vector<std::string>& values, const std::string& description);

  // Parameters of the command's stages. Each has a flag, and a key for --config, --print-config and
  // --set KEY=VALUE.
  libmap::ParameterTable& parameters();

  // Declares that the value of the parameter `key`, e.g. the name of a sensor, names a file with
  // further parameters, which `resolver` finds. Flags and --config override the file; "auto": none.
  void preset(const std::string& key,
              std::function<std::filesystem::path(const std::string&)> resolver);
  // Sets the function that finds the file of a --config value, e.g. of a name; default: a path.
  void config_resolver(std::function<std::filesystem::path(const std::string&)> resolver);

  // Parses argv, applies --config, then flags, then --set, and runs `body`. An error becomes one
  // line on stderr. Returns the exit code: 0 done, 1 failed, 2 wrong usage, 3 bad input.
  int run(int argc, char** argv, const std::function<void(Run&)>& body);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// Runs `chosen`, one of the usages of a command, and returns the exit code. Each usage has a
// separate Command and options; --help of the first shows all usages.
using Subcommand = int(int argc, char** argv);
int run_subcommand(int argc, char** argv, std::initializer_list<Subcommand*> subcommands,
                   Subcommand* chosen);

}  // namespace graspmap_tools

// What all commands share on the command line: inputs, the output, one flag for each parameter,
// --config, --print-config, --dry-run, one-line errors and exit codes.
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

// What the command line lacks before any file is looked at: exit code 2.
class UsageError : public libmap::Error {
 public:
  using Error::Error;
};

// Throws Error with the flag of the first parameter of `bind` that is not as it is by default.
template <typename Options>
void refuse_set(const Options& options, void (*bind)(libmap::ParameterTable&, Options&),
                const std::string& reason) {
  if (const auto key = libmap::changed_key(options, bind))
    throw libmap::Error(reason, {.field = libmap::flag_of(*key)});
}
// The same of options that are no parameters: flags, each with whether it was given.
void refuse_given(const std::vector<std::pair<const char*, bool>>& flags,
                  const std::string& reason);

class Command {
 public:
  // The description is that of commands.h, unless the command has several usages.
  explicit Command(const std::string& name, const std::string& description = {});
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  // Positional arguments, in the order in which they are added.
  void input(const std::string& name, std::string& path, const std::string& description);
  void inputs(const std::string& name, std::vector<std::string>& paths,
              const std::string& description);
  // -o, --output.
  void output(std::string& path, const std::string& description, bool required = true);
  // Flags and options that are no parameters of a stage, such as --json or --tile.
  void flag(const std::string& name, bool& value, const std::string& description);
  void option(const std::string& name, const std::string& value_name, std::string& value,
              const std::string& description, bool required = false);
  // A flag of earlier versions: the error of its use names `now` instead.
  void former_flag(const std::string& name, const std::string& now);
  void option(const std::string& name, const std::string& value_name,
              std::vector<std::string>& values, const std::string& description);

  // The parameters of the stages that the command runs: each becomes a flag and a key of --config
  // and --print-config. --set KEY=VALUE reaches them too.
  libmap::ParameterTable& parameters();

  // Resolves the value of --config, e.g. a scenario's name to a file. Default: a path.
  // A parameter that names a file of parameters, weaker than flags and --config; "auto": none.
  void preset(const std::string& key,
              std::function<std::filesystem::path(const std::string&)> resolver);
  void config_resolver(std::function<std::filesystem::path(const std::string&)> resolver);

  // Parses, applies --config and then the flags, runs `body`. Returns the exit code: 0 done,
  // 1 failed, 2 wrong usage, 3 bad input.
  int run(int argc, char** argv, const std::function<void(Run&)>& body);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// A command of several usages, each with a Command and options of its own: runs the one that was
// chosen. --help of the first shows all.
using Usage = int(int argc, char** argv);
int run_usage(int argc, char** argv, std::initializer_list<Usage*> usages, Usage* chosen);

}  // namespace graspmap_tools

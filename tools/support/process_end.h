// Removes unfinished outputs when a signal (SIGHUP, SIGINT, SIGTERM) ends a command, and detects
// standard output that could not be written.
#pragma once

#include <string>

namespace graspmap_tools {

// Installs handlers for SIGHUP, SIGINT and SIGTERM. They remove uncommitted outputs
// (libmap/core/file_output.h), then end the process by the default action of the same signal, so
// that the parent process sees the signal: $? of a shell is 129, 130 or 143, and make stops.
// Signals that are ignored at the start (nohup) remain ignored. A write beyond the limit on file
// size (ulimit -f) fails like one on a full disk instead of ending the process. Throws Error
// (failed) if no pipe can be created.
void end_cleanly_on_signals();

// If SIGHUP, SIGINT or SIGTERM was received, waits for the end of the process. Reports no errors.
void exit_if_signaled();

// Flushes standard output. Throws Error (failed) if not all of it was written.
void require_printed();

// Flushes standard output. Returns 0, or 1 with an error line on stderr if it was not all written.
int exit_code_of_printing(const std::string& program);

}  // namespace graspmap_tools

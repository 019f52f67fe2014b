// What a command does when a signal tells it to end.
#pragma once

namespace graspmap_tools {

// From here on SIGHUP, SIGINT and SIGTERM first remove what the process has in the making
// (libmap/core/file_output.h), then end it by the same signal with its default action, so
// that whoever waits for it sees the signal: a shell's $? is 129, 130, 143, and make stops. A
// signal that the process was started to ignore (nohup) stays ignored. A write beyond the limit on
// a file's size (ulimit -f) fails like one on a full disk instead of ending the process.
void end_cleanly_on_signals();

// Does not return if such a signal has come: what fails from then on fails because of it.
void end_if_told();

}  // namespace graspmap_tools

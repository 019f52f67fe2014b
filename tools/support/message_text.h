// What stands in a file may stand in a message, and a message goes to a terminal.
#pragma once

#include <string>

namespace graspmap_tools {

// One line of printable UTF-8: control characters and bytes that are no UTF-8 become \xNN, line
// breaks spaces, and of a very long text the middle is left out.
std::string message_text(const std::string& text);

}  // namespace graspmap_tools

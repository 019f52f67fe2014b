// Parameters, provenance and running times as HTML.
#pragma once

#include <string>

#include "libmap/report/report_content.h"

namespace libmap {

// Of one output a list of its parameters, inputs and results; of several, what differs side by side
// and what is the same in all.
std::string parameters_html(const ReportParameters& parameters);

// All outputs of a run, each folded: what made it, from what, with which parameters.
std::string sources_html(const ReportContent& content);

// Milliseconds, each step by each case, with sums for each command and in all.
std::string timings_html(const TimingTable& table);

std::string values_html(const ReportValues& values);  // names and values as a list

}  // namespace libmap

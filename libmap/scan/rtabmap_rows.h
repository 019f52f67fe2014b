// Rows that are written into an RTAB-Map database. Inner part of libmap/scan.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/rtabmap_blobs.h"

namespace libmap {

// Nothing becomes NULL. `blob` lives until the statement has run.
inline void bind_blob(SQLite::Statement& statement, int index, const std::string& blob) {
  if (blob.empty())
    statement.bind(index);
  else
    statement.bindNoCopy(index, blob.data(), static_cast<int>(blob.size()));
}

inline void run_once(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
  statement.clearBindings();
}

inline constexpr const char* rtabmap_link_insert =
    "INSERT INTO Link (from_id, to_id, type, information_matrix, transform) VALUES (?,?,?,?,?)";

// In both directions with the same matrix, as RTAB-Map does; priors, gravity and landmarks in one.
inline void insert_link(SQLite::Statement& insert, const PoseLink& link) {
  const auto run = [&](int from, int to, const Pose& from_from_to) {
    const std::string information = to_blob(link.information);
    const std::string transform = to_blob(from_from_to);
    insert.bind(1, from);
    insert.bind(2, to);
    insert.bind(3, static_cast<int>(link.type));
    bind_blob(insert, 4, information);
    bind_blob(insert, 5, transform);
    run_once(insert);
  };
  run(link.from, link.to, link.from_from_to);
  if (link.from != link.to && link.from > 0 && link.to > 0)
    run(link.to, link.from, link.from_from_to.inverse());
}

}  // namespace libmap

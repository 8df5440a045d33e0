#pragma once

// The tables, as append-only migrations counted by user_version.

#include "server/store/database.h"

namespace lightkiln {

// Brings the database to the newest schema in one transaction. Throws Error{unavailable} when it
// was written by a newer program. The caller holds the store's lock.
void migrate(Database& db);

// Throws Error{internal} when SQLite's quick check finds damage.
void check_integrity(Database& db);

}  // namespace lightkiln

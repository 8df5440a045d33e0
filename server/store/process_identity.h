#pragma once

// Who a process is, so that another one on this host can tell for certain that it is dead.

#include <string>

namespace lightkiln {

// "<boot id>/<pid namespace>/<pid>/<start time>" of this process.
std::string own_process_identity();

// True only when the process is proved dead: same boot and pid namespace, and no process with that
// pid and start time (or a zombie). Anything that cannot be judged counts as alive.
bool is_provably_dead(const std::string& identity);

// Identifies this boot of the host.
std::string boot_identity();

}  // namespace lightkiln

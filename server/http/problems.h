#pragma once

// Problem documents as replies. Every 4xx and 5xx of the daemon is made here.

#include <string>

#include "core/base/error.h"
#include "proto/problem.h"
#include "server/http/http.h"

namespace lightkiln {

// Adds Retry-After where trying again can help.
HttpReply problem_reply(const Problem& problem);
HttpReply error_reply(const Error& error, const std::string& request_id);
// For refusals by the HTTP layer. `status` is one of those of http_problem_code(); an empty detail
// takes the table's own words.
HttpReply status_reply(int status, const std::string& detail, const std::string& request_id);
// A document with faults: all of them at once.
HttpReply faults_reply(const std::vector<SpecFault>& faults, const std::string& request_id);

// The problem code that the HTTP layer gives a status: "method_not_allowed" for 405.
const char* http_problem_code(int status);

}  // namespace lightkiln

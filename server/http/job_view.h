#pragma once

// The store's records as the messages that clients see.

#include <string>
#include <vector>

#include "proto/messages.h"
#include "server/store/store.h"

namespace lightkiln {

// Everything in it follows from the record, so that equal versions give equal bytes.
JobMessage job_message(const JobRecord& job, const std::vector<ArtifactRecord>& artifacts);
// As it stands in a list: without spec, plan and artifacts, which can be large.
JobMessage listed_job_message(const JobRecord& job);
ArtifactMessage artifact_message(const ArtifactRecord& artifact);
EventMessage event_message(const EventRecord& event);

// Of the whole job: chunks count equally, plan and assembly count nothing.
double job_fraction(const JobRecord& job);
// What target_error and current_error of a kind measure.
std::string error_unit(const std::string& kind);

// Strong validators. They depend on what is shown and on the version of the program that shows it.
std::string job_etag(const JobRecord& job);
std::string list_etag(uint64_t list_version);
// The version inside a tag of job_etag's making; 0 for anything else.
uint64_t version_of_etag(const std::string& etag);

}  // namespace lightkiln

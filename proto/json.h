#pragma once

// Every structure that crosses the wire, to and from JSON text. nlohmann-json lives in proto/*.cpp
// only. Reading is strict: depth, duplicate keys, unknown keys (with the nearest known one), types,
// ranges and finiteness are all checked, and all faults of a document are reported at once, by JSON
// pointer.

#include <string>
#include <string_view>
#include <vector>

#include "core/bake/bake.h"

namespace lightkiln {

struct ParsedSpec {
  Spec spec;
  std::vector<SpecFault> faults;  // empty = valid; includes core's validate()
};
ParsedSpec parse_spec(std::string_view json);

// Canonical: every field with its default filled in, keys sorted, shortest round-trip numbers, no
// spaces.
std::string canonical_spec(const Spec& spec);
// "sha256:..." over the canonical spec and the engine version: equal digests are equal results.
std::string spec_digest(const std::string& canonical_json);
// The digests a spec names, sorted, each once.
std::vector<std::string> input_digests(const Spec& spec);

std::string write_plan(const Plan& plan);  // plan.json
Plan read_plan(std::string_view json);     // of our own writing; Error{internal} otherwise
std::string write_chunk_report(const ChunkReport& report);
ChunkReport read_chunk_report(std::string_view json);
std::string write_accuracy(const AccuracyRecord& record);  // accuracy.json
// Files in the formats of other programs, which core leaves to this floor: one for each ordered
// export of coefficients. To be added to the artifacts before the document lists them.
std::vector<Artifact> write_exports(const Assembly& assembly);
std::string export_name(ShTarget target);  // "sh_three.json", "sh_filament.txt"
// "ambient_occlusion.json", "environment_maps.json" or "probes.json": index, statistics,
// coefficients, the `convention` object and the self-test.
std::string write_document(const Assembly& assembly, const Spec& spec, const Plan& plan);
std::string document_name(Kind kind);

// SHA-256 as "sha256:<64 lower-case hex>".
std::string sha256_digest(const void* data, size_t size);
bool is_digest(std::string_view text);

}  // namespace lightkiln

#pragma once

// URIs inside a glTF: data embedded as base64, or names of files that were handed over with it.
// Nothing else is ever opened.

#include <cstddef>
#include <string>
#include <vector>

namespace lightkiln {

bool is_data_uri(const std::string& uri);

// The bytes of "data:[type][;parameters];base64,<data>". Throws Error{invalid_input} at `where`.
std::vector<std::byte> decode_data_uri(const std::string& uri, const std::string& where);

// The percent-decoded name of a relative URI, leading "./" removed: a key of
// GltfSource::resources. Throws Error{invalid_input} at `where` for a scheme, an absolute path, a
// ".." segment, a control character or a broken escape.
std::string resource_name(const std::string& uri, const std::string& where);

}  // namespace lightkiln

// openapi.json, the field tables and core/bake/spec.h say the same.

#include <algorithm>
#include <filesystem>
#include <set>

#include <gtest/gtest.h>

#include "proto/json_value.h"
#include "proto/json_writer.h"
#include "proto/messages.h"
#include "proto/problem.h"
#include "proto/spec_table.h"
#include "tests/support/data.h"

namespace lightkiln {
namespace {

namespace fs = std::filesystem;

JsonValue read_document(const fs::path& path) {
  const auto bytes = test::read_file(path);
  return read_trusted_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                           ErrorCode::internal, path.filename().string());
}

const JsonValue& openapi() {
  static const JsonValue document =
      read_document(fs::path(LIGHTKILN_SOURCE_DIR) / "proto" / "openapi.json");
  return document;
}

const JsonValue& schema(std::string_view name) {
  return *openapi().find("components")->find("schemas")->find(name);
}

const JsonValue* resolve(const JsonValue* value) {
  while (value && value->find("$ref")) {
    const std::string name = *value->find("$ref")->string();
    value = &schema(name.substr(name.rfind('/') + 1));
  }
  return value;
}

const std::string& spec_schema_name(Kind kind) {
  static const std::string names[] = {"AmbientOcclusionSpec", "EnvironmentMapsSpec", "ProbesSpec"};
  return names[static_cast<size_t>(kind)];
}

const JsonValue* property_at(Kind kind, std::string_view path) {
  const JsonValue* at = &schema(spec_schema_name(kind));
  while (at && !path.empty()) {
    path.remove_prefix(1);
    const std::string_view key = path.substr(0, path.find('/'));
    path.remove_prefix(key.size());
    const JsonValue* properties = at->find("properties");
    at = properties ? resolve(properties->find(key)) : nullptr;
  }
  return at;
}

std::string text(const JsonValue* value) {
  if (!value) return "absent";
  JsonWriter writer;
  writer.value(*value, true);
  return writer.take();
}

bool lists(const JsonValue* list, std::string_view name) {
  if (!list || !list->array()) return false;
  return std::any_of(list->array()->begin(), list->array()->end(), [&](const JsonValue& item) {
    return item.string() && *item.string() == name;
  });
}

// A row of GET /v1/kinds, which is written from the tables, against its property.
void expect_same(const JsonValue& row, const JsonValue* property) {
  const std::string type = *row.find("type")->string();
  SCOPED_TRACE(*row.find("pointer")->string());
  ASSERT_NE(property, nullptr) << "openapi.json does not know it";
  ASSERT_NE(property->find("description"), nullptr);
  if (type == "positions") {
    EXPECT_EQ(text(property->find("minItems")), text(row.find("minimum")));
    EXPECT_EQ(text(property->find("maxItems")), text(row.find("maximum")));
    return;
  }
  EXPECT_EQ(text(property->find("default")), text(row.find("default")));
  if (type == "names" || type == "numbers") {
    EXPECT_EQ(text(property->find("type")), "\"array\"");
    EXPECT_EQ(text(property->find("minItems")), text(row.find("min_items")));
    EXPECT_EQ(text(property->find("maxItems")), text(row.find("max_items")));
    const JsonValue* items = property->find("items");
    ASSERT_NE(items, nullptr);
    EXPECT_EQ(text(items->find("enum")), text(row.find("values")));
    EXPECT_EQ(text(items->find("minimum")), text(row.find("minimum")));
    EXPECT_EQ(text(items->find("exclusiveMinimum")), text(row.find("exclusive_minimum")));
    EXPECT_EQ(text(items->find("maximum")), text(row.find("maximum")));
    return;
  }
  const bool nullable = *row.find("nullable")->boolean();
  EXPECT_EQ(text(property->find("type")),
            nullable ? "[\"" + type + "\",\"null\"]" : "\"" + type + "\"");
  EXPECT_EQ(text(property->find("enum")), text(row.find("values")));
  EXPECT_EQ(text(property->find("exclusiveMinimum")), text(row.find("exclusive_minimum")));
  if (row.find("maximum") && row.find("maximum")->number() > 1e19) return;  // 2^64 - 1 as a double
  EXPECT_EQ(text(property->find("minimum")), text(row.find("minimum")));
  EXPECT_EQ(text(property->find("maximum")), text(row.find("maximum")));
}

TEST(OpenApi, HasEveryRowWithItsDefaultAndRange) {
  const JsonValue kinds = read_trusted_json(write_kinds(), ErrorCode::internal, "kinds");
  int rows = 0;
  for (const JsonValue& entry : *kinds.find("items")->array()) {
    const Kind kind = *std::find_if(std::begin(kKinds), std::end(kKinds), [&](Kind k) {
      return *entry.find("kind")->string() == kind_name(k);
    });
    for (const JsonValue& row : *entry.find("parameters")->array()) {
      expect_same(row, property_at(kind, *row.find("pointer")->string()));
      ++rows;
    }
    const JsonValue* error = property_at(kind, "/accuracy/target_error");
    const std::string stated = text(entry.find("default_target_error")) + " for " + kind_name(kind);
    EXPECT_NE(text(error->find("description")).find(stated), std::string::npos) << stated;
  }
  EXPECT_GE(rows, 24);
}

TEST(OpenApi, HasNoParameterWithoutARow) {
  for (const Kind kind : kKinds) {
    const KindTable& table = kind_table(kind);
    std::set<std::string> known = {"/kind", "/inputs", "/parameters", "/accuracy"};
    for (const InputRow& input : table.inputs) known.insert("/inputs/" + std::string(input.name));
    for (const ParameterGroup& group : table.groups) {
      if (!group.path.empty()) known.insert(std::string(group.path));
      for (const ParameterRow& row : group.rows)
        known.insert(std::string(group.path) + "/" + std::string(row.name));
    }
    std::vector<std::string> open = {""};
    while (!open.empty()) {
      const std::string path = open.back();
      open.pop_back();
      const JsonValue* at = property_at(kind, path);
      const JsonValue* properties = at->find("properties");
      if (!properties) continue;
      EXPECT_EQ(text(at->find("additionalProperties")), "false") << kind_name(kind) << path;
      for (const JsonMember& property : *properties->object()) {
        const std::string below = path + "/" + property.key;
        EXPECT_TRUE(known.contains(below)) << kind_name(kind) << " " << below;
        if (path != "/inputs") open.push_back(below);
      }
    }
    for (const InputRow& input : table.inputs) {
      const JsonValue* inputs = property_at(kind, "/inputs");
      EXPECT_EQ(lists(inputs->find("required"), input.name), input.required);
    }
  }
}

// Every property of every schema says what it is.
void expect_described(const JsonValue& value, const std::string& path) {
  if (const JsonValue* properties = value.find("properties")) {
    if (const JsonValue::Object* members = properties->object())
      for (const JsonMember& member : *members) {
        EXPECT_NE(member.value.find("description"), nullptr) << path << "/" << member.key;
      }
  }
  if (const JsonValue::Object* members = value.object())
    for (const JsonMember& member : *members)
      expect_described(member.value, path + "/" + member.key);
  if (const JsonValue::Array* items = value.array())
    for (size_t i = 0; i < items->size(); ++i)
      expect_described((*items)[i], path + "/" + std::to_string(i));
}

TEST(OpenApi, DescribesEveryProperty) {
  expect_described(*openapi().find("components")->find("schemas"), "");
}

TEST(OpenApi, EveryReferenceLeadsSomewhere) {
  std::vector<const JsonValue*> open = {&openapi()};
  int references = 0;
  while (!open.empty()) {
    const JsonValue* value = open.back();
    open.pop_back();
    if (value->array())
      for (const JsonValue& item : *value->array()) open.push_back(&item);
    if (!value->object()) continue;
    for (const JsonMember& member : *value->object()) {
      open.push_back(&member.value);
      if (member.key != "$ref") continue;
      ++references;
      const JsonValue* at = &openapi();
      std::string_view path = *member.value.string();
      ASSERT_TRUE(path.starts_with("#/"));
      path.remove_prefix(1);
      while (at && !path.empty()) {
        path.remove_prefix(1);
        const std::string_view key = path.substr(0, path.find('/'));
        path.remove_prefix(key.size());
        at = at->find(key);
      }
      EXPECT_NE(at, nullptr) << *member.value.string();
    }
  }
  EXPECT_GT(references, 50);
}

// A small part of JSON Schema, enough for our own documents: required members stand there, no
// member is undescribed, types and enumerations fit.
void expect_fits(const JsonValue& value, const JsonValue* shape, const std::string& path) {
  shape = resolve(shape);
  if (const JsonValue* any = shape->find("anyOf")) {
    if (value.is_null()) return;
    return expect_fits(value, &any->array()->front(), path);
  }
  if (const JsonValue* one = shape->find("oneOf")) {
    if (!shape->find("discriminator")) return;
    const size_t index = static_cast<size_t>(
        std::find_if(std::begin(kKinds), std::end(kKinds),
                     [&](Kind k) { return *value.find("kind")->string() == kind_name(k); }) -
        std::begin(kKinds));
    return expect_fits(value, &one->array()->at(index), path);
  }
  if (const JsonValue* required = shape->find("required"))
    for (const JsonValue& name : *required->array()) {
      EXPECT_NE(value.find(*name.string()), nullptr) << path << " lacks " << *name.string();
    }
  if (const JsonValue* names = shape->find("enum")) {
    ASSERT_NE(value.string(), nullptr) << path;
    EXPECT_TRUE(lists(names, *value.string())) << path << " is " << *value.string();
  }
  const std::string type = text(shape->find("type"));
  const bool nullable = type.find("\"null\"") != std::string::npos;
  if (value.is_null()) {
    EXPECT_TRUE(nullable) << path;
    return;
  }
  if (type == "\"string\"" || type == "[\"string\",\"null\"]") {
    EXPECT_NE(value.string(), nullptr) << path;
  }
  if (type == "\"array\"") {
    EXPECT_NE(value.array(), nullptr) << path;
  }
  if (type == "\"object\"") {
    EXPECT_NE(value.object(), nullptr) << path;
  }
  if (type == "\"boolean\"") {
    EXPECT_NE(value.boolean(), nullptr) << path;
  }
  uint64_t count = 0;
  int64_t number = 0;
  if (type == "\"integer\"") {
    EXPECT_TRUE(value.to_unsigned(&count) || value.to_signed(&number)) << path;
  }
  if (const JsonValue* items = shape->find("items"))
    for (const JsonValue& item : *value.array()) expect_fits(item, items, path + "/*");
  const JsonValue* properties = shape->find("properties");
  if (!properties || !value.object()) return;
  for (const JsonMember& member : *value.object()) {
    const JsonValue* property = properties->find(member.key);
    if (property) {
      expect_fits(member.value, property, path + "/" + member.key);
    } else {
      EXPECT_NE(shape->find("additionalProperties"), nullptr)
          << path << "/" << member.key << " is not described";
    }
  }
}

void expect_fits(const std::string& json, const char* name) {
  expect_fits(read_trusted_json(json, ErrorCode::internal, name), &schema(name), name);
}

TEST(OpenApi, DescribesWhatIsWritten) {
  JobMessage job;
  job.kind = "probes";
  job.state = "queued";
  job.stage = "plan";
  job.spec_json =
      R"({"kind":"probes","inputs":{"scene":"s"},"parameters":{"positions":[[0,0,0]]}})";
  job.created_ms = 1;
  job.error = JobErrorMessage{};
  job.artifacts.emplace_back();
  Plan plan;
  plan.effects.emplace_back();
  plan.repairs.emplace_back("NaN", 1);
  plan.chunks.emplace_back();
  plan.prices.emplace_back();
  job.plan_json = write_plan(plan);
  AccuracyRecord record;
  record.rounds.emplace_back();
  record.time_to_error.emplace_back();
  expect_fits(write_job(job), "Job");
  expect_fits(write_job_page({{job}, ""}), "JobPage");
  expect_fits(write_plan(plan), "Plan");
  expect_fits(write_accuracy(record), "AccuracyRecord");
  expect_fits(write_convergence(record), "Convergence");
  expect_fits(write_event_page({{1, "j", "log", 1, "{}"}}, 0), "EventPage");
  expect_fits(write_artifact_list("j", job.artifacts), "ArtifactList");
  expect_fits(write_missing({"x"}), "MissingBlobs");
  expect_fits(write_workers({{"w", {"landlock"}}}), "WorkerList");
  expect_fits(write_version({}), "Version");
  expect_fits(write_validation({job.spec_json, "d", {}}), "Validation");
  expect_fits(write_kinds(), "KindList");
  Problem problem = make_problem("invalid_spec", "x", "i");
  problem.errors.push_back({"/a", "range", "x", "y", "z"});
  expect_fits(write_problem(problem), "Problem");
}

TEST(OpenApi, ExamplesAreTaken) {
  int requests = 0;
  for (const auto& entry :
       fs::directory_iterator(fs::path(LIGHTKILN_SOURCE_DIR) / "proto" / "examples")) {
    const auto bytes = test::read_file(entry.path());
    const std::string json(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const ParsedJobRequest parsed = parse_job_request(json);
    for (const SpecFault& fault : parsed.faults)
      ADD_FAILURE() << entry.path() << " " << fault.pointer << ": " << fault.message;
    expect_fits(json, "JobRequest");
    ++requests;
  }
  EXPECT_GE(requests, 3);
}

}  // namespace
}  // namespace lightkiln

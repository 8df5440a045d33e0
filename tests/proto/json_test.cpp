#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include "core/base/error.h"
#include "proto/faults.h"
#include "proto/json_value.h"
#include "proto/json_writer.h"

namespace lightkiln {
namespace {

// The code of the one fault that reading gives, "" when there is none.
std::string fault_code(std::string_view text, const JsonLimits& limits = {}) {
  std::vector<SpecFault> faults;
  const JsonValue value = read_json(text, limits, &faults);
  EXPECT_LE(faults.size(), 1u);
  if (faults.empty()) return "";
  EXPECT_TRUE(value.is_null());
  EXPECT_FALSE(faults[0].message.empty());
  return faults[0].code;
}

JsonValue read_good(std::string_view text) {
  std::vector<SpecFault> faults;
  JsonValue value = read_json(text, JsonLimits{}, &faults);
  EXPECT_TRUE(faults.empty()) << text;
  return value;
}

std::string nested(int depth) {
  return std::string(static_cast<size_t>(depth), '[') +
         std::string(static_cast<size_t>(depth), ']');
}

TEST(Json, RefusesWhatIsNotJson) {
  for (const char* text : {"",
                           " ",
                           "{",
                           "}",
                           "[1,]",
                           "{\"a\":1,}",
                           "{'a':1}",
                           "{a:1}",
                           "nul",
                           "NaN",
                           "Infinity",
                           "-Infinity",
                           "[1] x",
                           "1 2",
                           "// c\n1",
                           "/* c */1",
                           "01",
                           "1.",
                           ".5",
                           "+1",
                           "0x10",
                           "\"\t\"",
                           "\"\\x\"",
                           "\"\\ud800\"",
                           "\"\\udc00\"",
                           "\"\xff\"",
                           "\"\xc0\x80\"",
                           "\"\xed\xa0\x80\"",
                           "\xEF\xBB\xBF{}",
                           "[1",
                           "\"abc"})
    EXPECT_EQ(fault_code(text), "syntax") << text;
  EXPECT_EQ(fault_code(std::string_view("{\"a\":1}\0", 8)), "syntax");
  EXPECT_EQ(fault_code("{\"a\":[1,2.5,-3,null,true,\"\\u00e9\"]}"), "");
}

TEST(Json, RefusesDepthBeyondTheLimitWithoutRecursion) {
  EXPECT_EQ(fault_code(nested(32)), "");
  EXPECT_EQ(fault_code(nested(33)), "too_large");
  EXPECT_EQ(fault_code(std::string(500000, '[')), "too_large");
  std::string objects;
  for (int i = 0; i < 100000; ++i) objects += "{\"a\":";
  EXPECT_EQ(fault_code(objects), "too_large");
}

TEST(Json, RefusesBytesBeyondTheLimit) {
  std::string text(1 << 20, 'a');
  text.front() = text.back() = '"';
  EXPECT_EQ(fault_code(text), "");
  EXPECT_EQ(fault_code(text + " "), "too_large");
}

TEST(Json, RefusesAKeyThatStandsTwiceAndNamesIt) {
  std::vector<SpecFault> faults;
  read_json(R"({"a":{"x":1,"y":2,"x":3}})", JsonLimits{}, &faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].code, "duplicate");
  EXPECT_EQ(faults[0].pointer, "/a/x");
  // The same name spelled with an escape is the same key.
  EXPECT_EQ(fault_code(R"({"a":1,"\u0061":2})"), "duplicate");
  EXPECT_EQ(fault_code(R"({"a":1,"b":{"a":2}})"), "");
}

TEST(Json, FindsADuplicateAmongManyKeysInReasonableTime) {
  std::string text = "{";
  for (int i = 0; i < 60000; ++i) text += "\"k" + std::to_string(i) + "\":0,";
  EXPECT_EQ(fault_code(text + "\"z\":0}"), "");
  EXPECT_EQ(fault_code(text + "\"k5\":0}"), "duplicate");
}

TEST(Json, RefusesNumbersThatADoubleCannotHold) {
  EXPECT_EQ(fault_code("[1e400]"), "range");
  EXPECT_EQ(fault_code("[-1e400]"), "range");
  EXPECT_EQ(fault_code("[1e-400]"), "range");
  EXPECT_EQ(fault_code("[0.0e-400]"), "");
  EXPECT_EQ(fault_code("[0e5]"), "");
  EXPECT_EQ(fault_code("[4.9406564584124654e-324]"), "");
  std::vector<SpecFault> faults;
  read_json(R"({"a":[0,1e400]})", JsonLimits{}, &faults);
  EXPECT_EQ(faults.at(0).pointer, "/a/1");
}

TEST(Json, ConvertsNumbersToIntegersOnlyWhereTheyAreIntegersThatFit) {
  uint64_t u = 7;
  int64_t i = 7;
  for (const char* text : {"1e30", "1.5", "1e2", "2.0", "true", "\"1\"", "18446744073709551616"}) {
    EXPECT_FALSE(read_good(text).to_unsigned(&u)) << text;
    EXPECT_FALSE(read_good(text).to_signed(&i)) << text;
  }
  EXPECT_FALSE(read_good("-1").to_unsigned(&u));
  EXPECT_TRUE(read_good("18446744073709551615").to_unsigned(&u));
  EXPECT_EQ(u, std::numeric_limits<uint64_t>::max());
  EXPECT_FALSE(read_good("18446744073709551615").to_signed(&i));
  EXPECT_TRUE(read_good("-9223372036854775808").to_signed(&i));
  EXPECT_EQ(i, std::numeric_limits<int64_t>::min());
}

TEST(Json, WritesNumbersThatReadBackToTheSameBits) {
  EXPECT_TRUE(rc::check([](uint64_t bits) {
    const double number = std::bit_cast<double>(bits);
    RC_PRE(std::isfinite(number));
    const std::string text = json_number(number);
    std::vector<SpecFault> faults;
    const JsonValue value = read_json(text, JsonLimits{}, &faults);
    RC_ASSERT(faults.empty());
    RC_ASSERT(std::bit_cast<uint64_t>(value.number()) == bits);
  }));
  for (const double number : {0.0, -0.0, 0.1, 1500.0, 1e22, 1e20, 9007199254740993.0, 5e-324,
                              1.7976931348623157e308, 1152921504606846976.0})
    EXPECT_EQ(std::bit_cast<uint64_t>(read_good(json_number(number)).number()),
              std::bit_cast<uint64_t>(number));
  EXPECT_EQ(json_number(0.1), "0.1");
  EXPECT_EQ(json_number(1500), "1500");
  EXPECT_EQ(json_number(-0.0), "-0.0");
}

TEST(Json, NeverWritesANumberThatIsNotFinite) {
  for (const double number : {NAN, INFINITY, -INFINITY}) {
    JsonWriter writer;
    writer.begin_object().key("error_rms");
    try {
      writer.value(number);
      FAIL() << "wrote " << writer.take();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::internal);
      EXPECT_NE(std::string(error.what()).find("error_rms"), std::string::npos);
    }
  }
}

TEST(Json, WritesAnyBytesAsValidText) {
  EXPECT_EQ(json_string("a\"\\\n\x01\x7f"), "\"a\\\"\\\\\\n\\u0001\\u007f\"");
  EXPECT_EQ(json_string("\xff\xc3"), "\"\xEF\xBF\xBD\xEF\xBF\xBD\"");
  EXPECT_TRUE(rc::check(
      [](const std::string& bytes) { RC_ASSERT(fault_code(json_string(bytes)).empty()); }));
  // Text that is UTF-8 already comes back as it was.
  for (const std::string text :
       {"gr\xC3\xBC\xC3\x9F", "\xF0\x9F\x94\xA5", "\xE2\x82\xAC", "\xEF\xBF\xBF"})
    EXPECT_EQ(*read_good(json_string(text)).string(), text);
}

TEST(Json, EscapesPointers) {
  EXPECT_EQ(json_pointer_token("a/b~c"), "a~1b~0c");
}

TEST(Faults, NameTheNearestKnownKey) {
  static constexpr std::string_view kKnown[] = {"max_distance", "falloff", "falloff_distance",
                                                "distribution", "target"};
  EXPECT_EQ(nearest_name("max_distanse", kKnown), "max_distance");
  EXPECT_EQ(nearest_name("maxDistance", kKnown), "max_distance");
  EXPECT_EQ(nearest_name("fallof", kKnown), "falloff");
  EXPECT_EQ(nearest_name("samples", kKnown), "");
  EXPECT_EQ(nearest_name(std::string(100000, 'a'), kKnown), "");
}

TEST(Faults, AreCountedBeyondAHundred) {
  FaultList faults;
  for (int i = 0; i < 250; ++i) faults.add({std::to_string(i), "type", "wrong"});
  const std::vector<SpecFault> told = faults.take();
  ASSERT_EQ(told.size(), 101u);
  EXPECT_NE(told.back().message.find("150"), std::string::npos);
}

}  // namespace
}  // namespace lightkiln

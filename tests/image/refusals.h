#pragma once

#include <string>

#include <gtest/gtest.h>

#include "core/base/error.h"

// Expects Error with ErrorCode::code and a sentence that contains `part`.
#define EXPECT_REFUSED(statement, expected_code, part)                                      \
  try {                                                                                     \
    static_cast<void>(statement);                                                           \
    ADD_FAILURE() << #statement " was accepted";                                            \
  } catch (const ::lightkiln::Error& refusal) {                                             \
    EXPECT_STREQ(::lightkiln::error_code_name(refusal.code()),                              \
                 ::lightkiln::error_code_name(::lightkiln::ErrorCode::expected_code))       \
        << refusal.what();                                                                  \
    EXPECT_NE(std::string(refusal.what()).find(part), std::string::npos) << refusal.what(); \
    EXPECT_EQ(std::string(refusal.what()).back(), '.') << refusal.what();                   \
  }                                                                                         \
  static_assert(true)

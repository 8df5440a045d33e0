#include "proto/json_view.h"

#include <climits>

namespace lightkiln {

void JsonView::refuse(const std::string& wanted) const {
  throw Error(code_, *what_ + " has " + value_->type_name() + " where " + wanted + " must stand.");
}

JsonView JsonView::at(std::string_view key) const {
  if (!value_->object()) refuse("an object");
  const JsonValue* member = value_->find(key);
  if (!member) throw Error(code_, *what_ + " has no member \"" + std::string(key) + "\".");
  return view(*member);
}

const JsonValue::Array& JsonView::items() const {
  if (!value_->array()) refuse("a list");
  return *value_->array();
}

const JsonValue::Object& JsonView::members() const {
  if (!value_->object()) refuse("an object");
  return *value_->object();
}

std::string JsonView::text() const {
  if (!value_->string()) refuse("text");
  return *value_->string();
}

double JsonView::number() const {
  if (!value_->is_number()) refuse("a number");
  return value_->number();
}

bool JsonView::boolean() const {
  if (!value_->boolean()) refuse("true or false");
  return *value_->boolean();
}

uint64_t JsonView::count() const {
  uint64_t number = 0;
  if (!value_->to_unsigned(&number)) refuse("a whole number of 0 or more");
  return number;
}

int JsonView::integer() const {
  int64_t number = 0;
  if (!value_->to_signed(&number) || number < INT_MIN || number > INT_MAX) refuse("a whole number");
  return static_cast<int>(number);
}

}  // namespace lightkiln

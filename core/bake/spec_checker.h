#pragma once

// How validate() gathers faults, and what its files check. Included by spec*.cpp only.

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/bake/spec.h"

namespace lightkiln {

// Collects faults; each check reads as one sentence of the contract.
class SpecChecker {
 public:
  void fault(std::string pointer, std::string code, std::string message, std::string allowed = "") {
    faults_.push_back(
        {std::move(pointer), std::move(code), std::move(message), std::move(allowed)});
  }
  void positive(const std::optional<double>& value, const std::string& pointer,
                const std::string& name) {
    if (value && !(std::isfinite(*value) && *value > 0))
      fault(pointer, "range", name + " must be a finite number above 0.");
  }
  template <typename T>
  void between(T value, T low, T high, const std::string& pointer, const std::string& name) {
    if (value < low || value > high)
      fault(pointer, "range",
            name + " is " + std::to_string(value) + "; allowed are " + std::to_string(low) +
                " to " + std::to_string(high) + ".");
  }
  std::vector<SpecFault> take() { return std::move(faults_); }

 private:
  std::vector<SpecFault> faults_;
};

// spec_maps.cpp: parameters of environment maps, and what probes have of them alike.
void check_environment_maps(const EnvironmentMapsParameters& p, SpecChecker& checker);
void check_source(const SourceParameters& p, const Spec& spec, SpecChecker& checker);
void check_rotation(const RotationParameters& p, SpecChecker& checker);
void check_window(ShWindow window, ShQuantity quantity, SpecChecker& checker);

}  // namespace lightkiln

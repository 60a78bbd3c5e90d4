#pragma once
#include <nlohmann/json.hpp>
#include <optional>

#include "drivers/study/evaluate/errors.h"
#include "platform/error/result.h"

/// What is not there is null.
template <class T>
struct nlohmann::adl_serializer<std::optional<T>> {
  static void to_json(ordered_json& json, const std::optional<T>& value) {
    if (value)
      json = *value;
    else
      json = nullptr;
  }
};

namespace epiline {

using Json = nlohmann::ordered_json;

/// rmse, mean, median, p95, max
Json to_json(const Summary& summary);

/// The `error` block of stats.json; `coverage` is null, the caller knows the images. Without poses every figure is
/// null.
Json to_json(const TrajectoryErrors& errors);

/// What `epiline evaluate --json` prints. `align`: the name of an Alignment.
Json evaluation_json(const TrajectoryErrors& errors, const std::string& align);
/// The error of an estimate that cannot be evaluated.
Error no_common_time(const std::string& estimate);

}  // namespace epiline

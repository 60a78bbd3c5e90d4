#pragma once
#include <stdexcept>
#include <utility>

#include "platform/error/result.h"

namespace epiline::test {

/// The value; an error fails and ends the test.
template <class T>
T must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().text());
  return std::move(*result);
}

}  // namespace epiline::test

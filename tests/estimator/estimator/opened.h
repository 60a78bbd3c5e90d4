#pragma once
// Opens the estimator to tests of states that no input produces: a number that is none in the middle of a flight.
#include "estimator/impl.h"

namespace epiline::test {

auto& opened(Estimator& estimator);

/// The arguments of an explicit instantiation may name what is private.
template <auto member>
struct Opener {
  friend auto& opened(Estimator& estimator) { return *(estimator.*member); }
};
template struct Opener<&Estimator::impl_>;

}  // namespace epiline::test

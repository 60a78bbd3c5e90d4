#include "platform/concurrency/loans.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace epiline {
namespace {

// Any sequence of operations, against a plain list of users.
RC_GTEST_PROP(Loans, BehavesLikeAListOfUsers, ()) {
  constexpr std::size_t kSlots = 4;
  Loans<kSlots> loans;
  std::vector<std::uint32_t> model(kSlots, 0);
  const auto operations = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000));
  for (const int operation : operations) {
    const auto slot = static_cast<std::size_t>(operation / 2) % kSlots;
    if (model[slot] == 0) {
      loans.lend(slot);
      model[slot] = 1;
    } else if (operation % 2 == 0) {
      loans.share(slot);
      ++model[slot];
    } else {
      RC_ASSERT(loans.give_back(slot) == (--model[slot] == 0));
    }
    for (std::size_t i = 0; i < kSlots; ++i) RC_ASSERT(loans.users(i) == model[i]);
  }
}

}  // namespace
}  // namespace epiline

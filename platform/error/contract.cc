#include "platform/error/contract.h"

#include <cstdio>
#include <cstdlib>

void epiline::detail::contract_broken(const char* file, int line, const char* condition, const char* text) noexcept {
  std::fprintf(stderr, "epiline: bug: %s:%d: %s (%s)\n", file, line, text, condition);
  std::abort();
}

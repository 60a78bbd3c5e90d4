#pragma once
// Contracts: what must hold if our own code is right. Broken ones end the program, in every build type. What a user, a
// file or a device can get wrong is a Result or an enum instead, never a contract.

namespace epiline::detail {
/// Prints `epiline: bug: FILE:LINE: text (condition)` on stderr and aborts. No heap, no locks of ours.
[[noreturn]] void contract_broken(const char* file, int line, const char* condition, const char* text) noexcept;
}  // namespace epiline::detail

/// Condition the caller must have established, `text` says it in words. The condition is evaluated exactly once.
#define EPILINE_EXPECTS(condition, text) \
  ((condition) ? static_cast<void>(0) : ::epiline::detail::contract_broken(__FILE__, __LINE__, #condition, text))

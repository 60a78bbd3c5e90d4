#pragma once
#include <string_view>

namespace epiline {

/// view.html and check.html, put into the program by the build. `@NONCE@` stands where the key of the
/// Content-Security-Policy goes.
extern const std::string_view kViewPage, kCheckPage;

}  // namespace epiline

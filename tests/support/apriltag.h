#pragma once
// Boards can be drawn and found only where the program was built with libapriltag.
#include <string>

namespace epiline::test {

/// Is that why it failed? Anything else is a failure of the test.
inline bool lacks_apriltag(const std::string& error) { return error.find("libapriltag") != std::string::npos; }

}  // namespace epiline::test

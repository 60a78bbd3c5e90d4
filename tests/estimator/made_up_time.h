#pragma once
#include "platform/time/clock.h"

namespace epiline::test {

/// Of a made-up flight; it may be before its beginning.
inline HostStamp at(double seconds) { return HostStamp{} + Span::from_seconds(100 + seconds); }

}  // namespace epiline::test

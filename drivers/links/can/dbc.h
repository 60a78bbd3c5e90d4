#pragma once
// The table of messages.h as a DBC file, which other programs on the bus read frames by. docs/epiline.dbc is the one of
// the default identifiers.
#include <string>

namespace epiline::can {

/// `base_id`: identifier of the first message, at most 0x7ff less the number of messages.
std::string dbc_text(int base_id);

}  // namespace epiline::can

#pragma once
#include <nlohmann/json.hpp>

#include "drivers/program/inventory/parts.h"

namespace epiline {

/// cameras, imus, spi, serial, can, gpio: a list each. A number that is not known is null.
nlohmann::ordered_json to_json(const Parts& parts);

}  // namespace epiline

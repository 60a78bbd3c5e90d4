// Any bytes as a table of numbers: parsed, or refused with a line number within the text.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "pipeline/text/table.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (const auto time : {epiline::TimeColumn::kNanoseconds, epiline::TimeColumn::kSeconds}) {
    const auto table = epiline::parse_table(text, "input", time, {4, 7, 8, 17}, "row");
    if (table) {
      if (table->values.size() != table->rows() * table->columns) std::abort();
    } else if (table.error().line < 0 || table.error().line > 1 + std::count(text.begin(), text.end(), '\n')) {
      std::abort();
    }
  }
  return 0;
}

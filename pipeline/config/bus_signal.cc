#include "pipeline/config/bus_signal.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

namespace epiline {

namespace {

constexpr std::uint32_t kMostStandard = 0x7ff, kMostExtended = 0x1fffffff, kExtended = 0x80000000;

/// Takes one piece after another; blanks may be between them.
class Reader {
 public:
  explicit Reader(std::string_view text) : rest_(text) { skip_blanks(); }

  bool take(std::string_view piece) {
    if (!rest_.starts_with(piece)) return false;
    rest_.remove_prefix(piece.size());
    skip_blanks();
    return true;
  }
  template <class T, class... Format>
  bool number(T& value, Format... format) {
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value, format...);
    if (error != std::errc{}) return false;
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    skip_blanks();
    return true;
  }
  bool is_at_end() const { return rest_.empty(); }

 private:
  void skip_blanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }
  std::string_view rest_;
};

bool read(Reader& r, std::uint32_t& id, BusSignal& s) {
  const bool has_id = r.take("0x") || r.take("0X") ? r.number(id, 16) : r.number(id);
  if (!has_id || !r.number(s.start_bit) || !r.take("|") || !r.number(s.length) || !r.take("@")) return false;
  s.big_endian = r.take("0");
  if (!s.big_endian && !r.take("1")) return false;
  s.is_signed = r.take("-");
  if (!s.is_signed && !r.take("+")) return false;
  return r.take("(") && r.number(s.scale) && r.take(",") && r.number(s.offset) && r.take(")") && r.is_at_end();
}

}  // namespace

std::variant<BusSignal, std::string> bus_signal_from(const std::string& text) {
  if (text.empty()) return BusSignal{};
  BusSignal s;
  std::uint32_t id = 0;
  Reader reader(text);
  if (!read(reader, id, s)) return kBusSignalForm;
  s.id = id & ~kExtended;
  s.extended = id > kMostStandard;
  if (s.id > kMostExtended)
    return fmt::format("an identifier up to {} (29 bits), or with bit 31 set as in a DBC file", kMostExtended);
  if (!fits(s)) return "a signal of 1 to 64 bits within 64 bytes";
  if (!std::isfinite(s.scale) || s.scale == 0 || !std::isfinite(s.offset)) return "finite numbers, the scale not 0";
  return s;
}

std::string to_text(const BusSignal& s) {
  if (s.length == 0) return "";
  const std::uint32_t mark = s.extended && s.id <= kMostStandard ? kExtended : 0;
  return fmt::format("{} {}|{}@{}{} ({},{})", s.id | mark, s.start_bit, s.length, s.big_endian ? 0 : 1,
                     s.is_signed ? '-' : '+', s.scale, s.offset);
}

}  // namespace epiline

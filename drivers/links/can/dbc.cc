#include "drivers/links/can/dbc.h"

#include <cstdarg>
#include <cstdio>

#include "drivers/links/can/messages.h"
#include "platform/samples/samples.h"

namespace epiline::can {

namespace {

constexpr int kStandardCanFd = 14;  // of the attribute VFrameFormat

[[gnu::format(printf, 2, 3)]] void add(std::string& text, const char* format, ...) {
  char line[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  text += line;
}

void add_signal(std::string& text, const Signal& s) {
  add(text, " SG_ %s : %u|%u@1%c (%.10g,0) [%.15g|%.15g] \"%s\" Vector__XXX\n", s.name, s.start, s.length,
      s.coding == Coding::kSigned ? '-' : '+', s.scale, static_cast<double>(s.least()) * s.scale,
      static_cast<double>(s.most()) * s.scale, s.unit);
}

std::string reasons_text(const Signal& s) {
  std::string text = s.comment;
  for (std::size_t i = 0; i < kHealthReasonNames.size(); ++i)
    text += (i == 0 ? ": " : ", ") + std::to_string(i) + " " + kHealthReasonNames[i];
  return text;
}

void add_comments(std::string& text, const Message& m, int id) {
  if (*m.comment != '\0') add(text, "CM_ BO_ %d \"%s\";\n", id, m.comment);
  for (const Signal& s : m.signals) {
    const std::string comment = s.quantity == Quantity::kReasons ? reasons_text(s) : s.comment;
    if (!comment.empty()) text += "CM_ SG_ " + std::to_string(id) + " " + s.name + " \"" + comment + "\";\n";
  }
}

void add_values(std::string& text, const Message& m, int id) {
  for (const Signal& s : m.signals) {
    if (!s.has_gap_value()) continue;
    add(text, "VAL_ %d %s", id, s.name);
    if (s.quantity == Quantity::kState)
      for (std::size_t i = 0; i < kStateNames.size(); ++i) add(text, " %zu \"%s\"", i, kStateNames[i]);
    add(text, " %lld \"not available\" ;\n", static_cast<long long>(s.not_available()));
  }
}

}  // namespace

std::string dbc_text(int base_id) {
  const auto id_of = [&](const Message& m) { return base_id + m.id_offset; };
  std::string text;
  add(text, "VERSION \"%d\"\n\nNS_ :\n\nBS_:\n\nBU_: Epiline\n", kLayoutVersion);
  for (const Message& m : kMessages) {
    add(text, "\nBO_ %d %s: %d Epiline\n", id_of(m), m.name, m.size);
    for (const Signal& s : m.signals) add_signal(text, s);
  }
  add(text, "\nCM_ \"Odometry of epiline. A number that is out of its range is sent as the end of the range.\";\n");
  for (const Message& m : kMessages) add_comments(text, m, id_of(m));
  add(text, "BA_DEF_ \"BusType\" STRING ;\nBA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\"");
  for (int i = 2; i < kStandardCanFd; ++i) add(text, ",\"reserved\"");
  add(text, ",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\n");
  add(text, "BA_DEF_DEF_ \"BusType\" \"CAN\";\nBA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n");
  add(text, "BA_ \"BusType\" \"CAN FD\";\n");
  for (const Message& m : kMessages)
    if (m.size > kClassicBytes) add(text, "BA_ \"VFrameFormat\" BO_ %d %d;\n", id_of(m), kStandardCanFd);
  for (const Message& m : kMessages) add_values(text, m, id_of(m));
  return text;
}

}  // namespace epiline::can

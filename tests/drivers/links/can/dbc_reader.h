#pragma once
// Reads frames by a DBC file alone, bit by bit as the format counts them. It knows nothing of our table: what it reads
// back is what anybody else would.
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <regex>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>

namespace epiline::dbc {

struct SignalText {
  int start = 0, length = 0;
  bool little_endian = true, is_signed = false;
  double scale = 1, offset = 0, least = 0, most = 0;
  std::string unit;
  std::map<long long, std::string> names;
};

struct MessageText {
  std::string name;
  std::size_t size = 0;
  bool fd = false;
  std::map<std::string, SignalText> signals;
};

inline std::map<int, MessageText> read(const std::string& text) {
  static const std::regex message(R"(BO_ (\d+) (\w+): (\d+) (\w+))");
  static const std::regex signal(
      R"re( SG_ (\w+) : (\d+)\|(\d+)@([01])([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\] "([^"]*)" (\w+))re");
  static const std::regex values(R"re(VAL_ (\d+) (\w+)((?: -?\d+ "[^"]*")+) ;)re"), value(R"re( (-?\d+) "([^"]*)")re");
  static const std::regex format(R"re(BA_ "VFrameFormat" BO_ (\d+) (\d+);)re");
  std::map<int, MessageText> messages;
  int id = -1;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::smatch m;
    if (std::regex_match(line, m, message)) {
      id = std::stoi(m[1]);
      if (messages.count(id) != 0) throw std::runtime_error("twice: " + line);
      messages[id] = {m[2], std::stoul(m[3]), false, {}};
    } else if (std::regex_match(line, m, signal)) {
      messages.at(id).signals[m[1]] = {std::stoi(m[2]), std::stoi(m[3]), m[4] == "1",     m[5] == "-", std::stod(m[6]),
                                       std::stod(m[7]), std::stod(m[8]), std::stod(m[9]), m[10],       {}};
    } else if (std::regex_match(line, m, values)) {
      auto& names = messages.at(std::stoi(m[1])).signals.at(m[2]).names;
      const std::string list = m[3];
      for (std::sregex_iterator i(list.begin(), list.end(), value), end; i != end; ++i)
        names[std::stoll((*i)[1])] = (*i)[2];
    } else if (std::regex_match(line, m, format)) {
      messages.at(std::stoi(m[1])).fd = m[2] == "14";
    } else if (line.rfind("BO_ ", 0) == 0 || line.rfind(" SG_", 0) == 0 || line.rfind("VAL_", 0) == 0) {
      throw std::runtime_error("not understood: " + line);
    }
  }
  return messages;
}

/// Bits from the highest to the lowest. Byte order 1: the start is the lowest bit, higher ones follow upwards. Byte
/// order 0: the start is the highest bit, lower ones follow downwards, and after bit 0 of a byte comes bit 7 of the
/// next.
inline std::uint64_t bits_of(const SignalText& s, std::span<const std::uint8_t> data) {
  const auto bit_at = [&](int position) {
    const auto byte = static_cast<std::size_t>(position / 8);
    if (byte >= data.size()) throw std::runtime_error("signal beyond the frame");
    return static_cast<std::uint64_t>(data[byte] >> position % 8 & 1);
  };
  std::uint64_t raw = 0;
  if (s.little_endian) {
    for (int i = s.length - 1; i >= 0; --i) raw = raw * 2 + bit_at(s.start + i);
  } else {
    int position = s.start;
    for (int i = 0; i < s.length; ++i) {
      raw = raw * 2 + bit_at(position);
      position = position % 8 == 0 ? position + 15 : position - 1;
    }
  }
  return raw;
}

struct Reading {
  long long raw = 0;
  double value = 0;
  std::string name;  ///< of VAL_; empty: none
};

inline Reading read(const SignalText& s, std::span<const std::uint8_t> data) {
  const std::uint64_t bits = bits_of(s, data);
  auto raw = static_cast<long long>(bits);
  if (s.is_signed && s.length < 64 && (bits >> (s.length - 1) & 1) != 0) raw -= 1LL << s.length;
  const auto name = s.names.find(raw);
  return {raw, static_cast<double>(raw) * s.scale + s.offset, name == s.names.end() ? "" : name->second};
}

}  // namespace epiline::dbc

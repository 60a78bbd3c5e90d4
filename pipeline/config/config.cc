#include "pipeline/config/config.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cstdlib>

#include "pipeline/text/nearest.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace {

template <class... F>
struct Overloaded : F... {
  using F::operator()...;
};
template <class... F>
Overloaded(F...) -> Overloaded<F...>;

using Value = ConfigFile::Value;

template <class T>
using At = T* (*)(Config&);

/// What the parameter takes.
std::string range_of(const Parameter& p) {
  const std::string unit = p.unit.empty() ? "" : " " + p.unit;
  return std::visit(
      Overloaded{[](At<bool>) -> std::string { return "true or false"; },
                 [&](At<int>) { return fmt::format("an integer from {} to {}{}", p.min, p.max, unit); },
                 [&](auto* (*)(Config&)) { return fmt::format("a number from {} to {}{}", p.min, p.max, unit); },
                 [](At<std::string>) -> std::string { return "a text in quotes"; },
                 [&](const NamedValues& v) {
                   const std::string form = "{ name = integer, ... }";
                   if (v.names.empty()) return form;
                   return fmt::format("{}; names {}; integers from {} to {}", form, fmt::join(v.names, ", "), p.min,
                                      p.max);
                 },
                 [&](const Numbers& n) {
                   std::vector<std::string> ranges;
                   for (const auto& [min, max] : n.ranges) ranges.push_back(fmt::format("{} to {}", min, max));
                   const bool are_alike = std::count(ranges.begin(), ranges.end(), ranges[0]) == std::ssize(ranges);
                   if (are_alike) ranges.resize(1);
                   return fmt::format("{} numbers from {}{}", n.ranges.size(), fmt::join(ranges, ", "), unit);
                 },
                 [](At<BusSignal>) -> std::string { return kBusSignalForm; },
                 [](const Choice& c) { return fmt::format("\"{}\"", fmt::join(c.names, "\" or \"")); }},
      p.value);
}

std::optional<Value> named_values(const Parameter& p, const std::vector<std::string>& names, const toml::node& node) {
  if (!node.is_table()) return std::nullopt;
  std::vector<NamedValue> values;
  for (const auto& [name, value] : *node.as_table()) {
    if (!value.is_integer()) return std::nullopt;
    const NamedValue v{std::string(name.str()), *value.value<std::int64_t>()};
    const bool is_listed = std::find(names.begin(), names.end(), v.name) != names.end();
    const auto number = static_cast<double>(v.value);
    if (!names.empty() && (!is_listed || number < p.min || number > p.max)) return std::nullopt;
    values.push_back(v);
  }
  // as the file has them, not by name: some devices take a control only after another
  const toml::table& table = *node.as_table();
  std::stable_sort(values.begin(), values.end(), [&](const NamedValue& a, const NamedValue& b) {
    const auto at = [&](const NamedValue& v) { return table.get(v.name)->source().begin; };
    return std::pair(at(a).line, at(a).column) < std::pair(at(b).line, at(b).column);
  });
  return values;
}

std::optional<Value> several_numbers(const std::vector<Numbers::Range>& ranges, const toml::node& node) {
  const toml::array* const array = node.as_array();
  if (array == nullptr || array->size() != ranges.size()) return std::nullopt;
  std::vector<double> values;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    if (!(*array)[i].is_number()) return std::nullopt;
    values.push_back(*(*array)[i].value<double>());
    if (!(values[i] >= ranges[i].min && values[i] <= ranges[i].max)) return std::nullopt;
  }
  return values;
}

/// A path as a shell would read it: ~/ is the user's home.
std::string from_home(std::string text) {
  const char* const home = text.starts_with("~/") ? std::getenv("HOME") : nullptr;
  return home == nullptr ? text : home + text.substr(1);
}

/// The node's value in the type of the parameter, if it has that type and lies in the range.
std::optional<Value> checked_value(const Parameter& p, const toml::node& node) {
  using Checked = std::optional<Value>;
  const auto in_range = [&](double v) { return v >= p.min && v <= p.max; };
  const auto text = node.value_exact<std::string>();
  return std::visit(
      Overloaded{[&](At<bool>) { return node.is_boolean() ? Checked(*node.value<bool>()) : std::nullopt; },
                 [&](At<int>) -> Checked {
                   const auto value = node.value_exact<std::int64_t>();
                   if (!value || !in_range(static_cast<double>(*value))) return std::nullopt;
                   return static_cast<int>(*value);
                 },
                 [&](At<double>) -> Checked {
                   if (!node.is_number() || !in_range(*node.value<double>())) return std::nullopt;
                   return *node.value<double>();
                 },
                 [&](At<std::string>) { return text ? Checked(from_home(*text)) : std::nullopt; },
                 [&](const NamedValues& v) { return named_values(p, v.names, node); },
                 [&](const Numbers& n) { return several_numbers(n.ranges, node); },
                 [&](At<BusSignal>) -> Checked {
                   if (!text) return std::nullopt;
                   const auto signal = bus_signal_from(*text);
                   return std::holds_alternative<BusSignal>(signal) ? Checked(std::get<BusSignal>(signal))
                                                                    : std::nullopt;
                 },
                 [&](const Choice& c) -> Checked {
                   const auto found = text ? std::find(c.names.begin(), c.names.end(), *text) : c.names.end();
                   if (found == c.names.end()) return std::nullopt;
                   return static_cast<int>(found - c.names.begin());
                 }},
      p.value);
}

/// What the parameter takes, and what of it this text is not.
std::string expected_instead(const Parameter& p, const std::optional<std::string>& text) {
  if (!text || !std::holds_alternative<At<BusSignal>>(p.value)) return range_of(p);
  const auto signal = bus_signal_from(*text);
  return std::holds_alternative<std::string>(signal) ? std::get<std::string>(signal) : range_of(p);
}

/// The first byte that belongs to no character of UTF-8 and none of ASCII; its size if there is none.
std::size_t first_not_utf8(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  for (std::size_t i = 0; i < text.size();) {
    const unsigned lead = byte(i);
    const std::size_t more = lead < 0x80 ? 0 : lead < 0xe0 ? 1 : lead < 0xf0 ? 2 : 3;
    if (more > 0 && (lead < 0xc2 || lead > 0xf4)) return i;
    for (std::size_t k = 1; k <= more; ++k)
      if ((byte(i + k) & 0xc0) != 0x80) return i;
    i += more + 1;
  }
  return text.size();
}

/// A text that is not stored as UTF-8.
std::optional<Error> wrong_encoding(std::string_view text, const std::string& name) {
  const auto fail = [&](std::size_t at, std::string found) {
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    return Error{ErrorKind::kUsage, name, static_cast<int>(line), std::move(found),
                 "a text in UTF-8: save the file as UTF-8"};
  };
  if (text.find('\0') != text.npos) return fail(0, "looks like UTF-16");
  const std::size_t at = first_not_utf8(text);
  if (at == text.size()) return std::nullopt;
  const unsigned byte = static_cast<unsigned char>(text[at]);
  if (byte < 0xa0) return fail(at, fmt::format("holds the byte 0x{:02X}, which is not UTF-8", byte));
  return fail(at, fmt::format("holds the byte 0x{:02X}, which is not UTF-8 ('{}{}' in Latin-1)", byte,
                              static_cast<char>(0xc0 | byte >> 6), static_cast<char>(0x80 | (byte & 0x3f))));
}

const Parameter* find_parameter(const std::string& name) {
  for (const Parameter& p : parameters()) {
    if (p.name == name) return &p;
  }
  return nullptr;
}

/// What replaces a setting of older versions; empty: nothing does.
std::string successor(const std::string& name) {
  struct Successor {
    const char* now;
    std::vector<const char*> before;  ///< names, or what they begin with
  };
  static const std::vector<Successor> successors = {
      {"realtime.priority = 80, which is the IMU's", {"realtime.priority_"}},
      {"realtime.cpus = { imu = 3, estimate = 2 }", {"realtime.cpu_"}},
      {"body.yaw_pitch_roll_deg = [yaw, pitch, roll]", {"body.yaw_deg", "body.pitch_deg", "body.roll_deg"}},
      {"mavlink.origin = [latitude, longitude, altitude]", {"mavlink.origin_"}},
      {"wheel.signal, such as \"291 7|16@0- (0.01,0)\": identifier and signal as in a DBC file",
       {"wheel.id", "wheel.extended", "wheel.start_bit", "wheel.length", "wheel.big_endian", "wheel.is_signed",
        "wheel.scale_m_s", "wheel.offset_m_s"}},
      {"wheel.position_m = [forward, left, up]", {"wheel.x_m", "wheel.y_m", "wheel.z_m"}},
      {"height.range_position_m = [forward, left, up]", {"height.range_x_m", "height.range_y_m", "height.range_z_m"}},
      {"height.range_limits_m = [shortest, longest]", {"height.range_least_m", "height.range_most_m"}},
      {"height.range_tilt_deg = [forward, left]", {"height.range_forward_deg", "height.range_left_deg"}},
      {"gyroscope_saturation and accelerometer_saturation in the file that imu.calibration names",
       {"imu.gyroscope_saturation", "imu.accelerometer_saturation"}},
      {"ROS_DOMAIN_ID in the environment", {"dds.domain"}},
      {"nothing in its place: flights use the factor track, with which `epiline-study replay --visual-factor` compares "
       "others",
       {"estimator.visual_factor"}},
  };
  for (const auto& [now, before] : successors)
    if (std::any_of(before.begin(), before.end(), [&](const char* old) { return name.starts_with(old); })) return now;
  return "";
}

/// For a setting that does not exist: what replaces it, or the existing ones to choose from.
std::string listed_name(const std::string& wrong) {
  if (std::string now = successor(wrong); !now.empty()) return now;
  std::vector<std::string> names;
  for (const Parameter& p : parameters()) names.push_back(p.name);
  const std::string meant = nearest(wrong, names);
  return (meant.empty() ? "" : "\"" + meant + "\", or ") + "a name that `epiline config` lists";
}

bool is_section(const std::string& name) {
  return std::any_of(parameters().begin(), parameters().end(),
                     [&](const Parameter& p) { return p.name.rfind(name + ".", 0) == 0; });
}

std::string listed_section(const std::string& wrong) {
  std::vector<std::string> names;
  for (const Parameter& p : parameters()) names.push_back(p.name.substr(0, p.name.find('.')));
  const std::string meant = nearest(wrong, names);
  return (meant.empty() ? "" : "[" + meant + "], or ") + "a name that `epiline config` lists";
}

std::string shown(const toml::node& node) {
  if (node.is_string()) return fmt::format("\"{}\"", *node.value<std::string>());
  if (const toml::array* const array = node.as_array()) {  // in one line
    std::string text;
    for (const toml::node& element : *array) text += (text.empty() ? "" : ", ") + shown(element);
    return "[" + text + "]";
  }
  std::ostringstream out;
  node.visit([&](const auto& n) { out << n; });
  return out.str();
}

std::string toml_value(const Parameter& p, const Config& config) {
  Config copy = config;
  return std::visit(
      Overloaded{[&](At<bool> at) -> std::string { return *at(copy) ? "true" : "false"; },
                 [&](At<int> at) { return fmt::format("{}", *at(copy)); },
                 [&](auto* (*at)(Config&)) { return fmt::format("{}", *at(copy)); },
                 [&](At<std::string> at) { return toml_text(*at(copy)); },
                 [&](const NamedValues& values) {
                   std::string text;
                   for (const NamedValue& v : *values.at(copy)) {
                     text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", toml_text(v.name), v.value);
                   }
                   return text.empty() ? std::string("{}") : "{ " + text + " }";
                 },
                 [&](const Numbers& n) {
                   return fmt::format("[{}]", fmt::join(n.at(copy), n.at(copy) + n.ranges.size(), ", "));
                 },
                 [&](At<BusSignal> at) { return toml_text(to_text(*at(copy))); },
                 [&](const Choice& c) { return "\"" + c.names[static_cast<std::size_t>(c.get(config))] + "\""; }},
      p.value);
}

/// A section like that of the second camera, in which nothing is set.
bool is_repetition(const std::string& section, const Config& config) {
  if (section != kOtherCameraSections[1] && section != kOtherCameraSections[2]) return false;
  return std::none_of(parameters().begin(), parameters().end(), [&](const Parameter& p) {
    return p.name.starts_with(section + ".") && toml_value(p, config) != toml_value(p, Config{});
  });
}

}  // namespace

// toml++ would write a text that begins with a new line so that the line is lost when it is read again.
std::string toml_text(const std::string& text) {
  std::string s = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      (s += '\\') += c;
    } else if (code < 0x20 || code == 0x7f) {
      s += fmt::format("\\u{:04x}", code);
    } else {
      s += c;
    }
  }
  return s + "\"";
}

Result<ConfigFile> ConfigFile::read(const std::filesystem::path& path, const std::vector<std::string>& sets) {
  ConfigFile file;
  if (!path.empty()) {
    const auto text = read_text(path);
    if (!text) return text.error();
    auto parsed = parse(*text, path.string());
    if (!parsed) return parsed;
    file = std::move(*parsed);
    for (auto& [p, value] : file.settings_)
      if (auto* const named = std::get_if<std::string>(&value); p->beside_file && named && !named->empty())
        *named = (path.parent_path() / *named).string();
  }
  for (const std::string& set : sets) {
    if (const Status s = file.set(set); !s) return s.error();
  }
  return file;
}

Status ConfigFile::set(const std::string& text) {
  const auto fail = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, "--set " + text, 0, std::move(found), std::move(expected)};
  };
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return fail("no value", "SECTION.KEY=VALUE");
  const std::string name = text.substr(0, equals), value = text.substr(equals + 1);
  const Parameter* const p = find_parameter(name);
  if (p == nullptr) return fail("unknown setting \"" + name + "\"", listed_name(name));
  const auto as_toml = [&](const std::string& v) -> std::optional<Value> {
    try {
      const toml::table table = toml::parse("value = " + v);
      return table.size() == 1 ? checked_value(*p, *table.get("value")) : std::nullopt;
    } catch (const toml::parse_error&) {
      return std::nullopt;
    }
  };
  auto checked = as_toml(value);
  if (!checked) checked = as_toml("[" + value + "]");
  if (!checked) checked = as_toml(toml_text(value));
  if (!checked) return fail("\"" + value + "\"", expected_instead(*p, value));
  settings_.emplace_back(p, std::move(*checked));
  return Done{};
}

Result<ConfigFile> ConfigFile::parse(std::string_view text, const std::string& name) {
  const auto fail = [&](const toml::source_region& at, std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, name, static_cast<int>(at.begin.line), std::move(found), std::move(expected)};
  };
  if (auto wrong = wrong_encoding(text, name)) return std::move(*wrong);
  toml::table root;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& e) {
    return fail(e.source(), std::string(e.description()), "a configuration in TOML");
  }
  ConfigFile file;
  for (const auto& [section, entry] : root) {
    const std::string section_name(section.str());
    if (!is_section(section_name)) {
      return fail(section.source(), "unknown section \"" + section_name + "\"", listed_section(section_name));
    }
    if (!entry.is_table())
      return fail(section.source(), "\"" + section_name + "\" is not a section", "[" + section_name + "]");
    for (const auto& [key, node] : *entry.as_table()) {
      const std::string full = section_name + "." + std::string(key.str());
      const Parameter* p = find_parameter(full);
      if (!p) return fail(key.source(), "unknown key \"" + full + "\"", listed_name(full));
      const auto value = checked_value(*p, node);
      if (!value)
        return fail(node.source(), full + " = " + shown(node), expected_instead(*p, node.value<std::string>()));
      file.settings_.emplace_back(p, *value);
    }
  }
  return file;
}

void ConfigFile::apply(Config& config) const {
  const auto put = [&]<class T>(T* to, const Value& value) { *to = std::get<T>(value); };
  for (const auto& [p, value] : settings_) {
    std::visit(Overloaded{[&, v = &value](auto* (*at)(Config&)) { put(at(config), *v); },
                          [&, v = &value](const NamedValues& to) { put(to.at(config), *v); },
                          [&, v = &value](const Numbers& to) {
                            std::ranges::copy(std::get<std::vector<double>>(*v), to.at(config));
                          },
                          [&, v = &value](const Choice& c) { c.set(config, std::get<int>(*v)); }},
               p->value);
  }
}

std::string to_toml(const Config& config) {
  std::string text, section;
  for (const Parameter& p : parameters()) {
    const std::size_t dot = p.name.find('.');
    if (is_repetition(p.name.substr(0, dot), config)) continue;
    if (p.name.substr(0, dot) != section) {
      section = p.name.substr(0, dot);
      text += fmt::format("{}[{}]\n", text.empty() ? "" : "\n", section);
    }
    const std::string value = toml_value(p, config);
    const bool is_empty = value == "\"\"" || value == "{}";
    text +=
        fmt::format("# {}; {}\n{}{} = {}\n", p.text, range_of(p), is_empty ? "#" : "", p.name.substr(dot + 1), value);
  }
  return text;
}

}  // namespace epiline

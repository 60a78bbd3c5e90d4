#pragma once
// All settings, in one table (parameters.cc): struct, check of the TOML file, listing and manual are made from it.
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "estimator/estimator.h"
#include "pipeline/config/devices.h"
#include "pipeline/config/realtime_config.h"
#include "pipeline/vision/tracker_config.h"
#include "platform/error/result.h"

namespace epiline {

struct Config {
  EstimatorConfig estimator;
  TrackerConfig tracker;
  double deadline_ms = 0;  ///< longest time for the solve of one image; 0: no limit
  RealtimeConfig realtime;
  RecorderConfig recorder;
  DevicesConfig devices;
  std::string camera_calibration;  ///< replaces the data set's file
  std::string imu_calibration;
  std::array<std::string, 1 + kMostOthers> masks;  ///< files, of each camera; empty: none
};

/// A setting with a few named values.
struct Choice {
  std::vector<std::string> names;
  int (*get)(const Config&);
  void (*set)(Config&, int);
};

/// Some integers by name, a table `{ name = value, ... }`.
struct NamedValues {
  std::vector<NamedValue>* (*at)(Config&);
  std::vector<std::string> names;  ///< that may occur, with integers in the parameter's range; empty: any, of any value
};

/// A fixed number of numbers, `[1, 2, 3]`, each with its own range.
struct Numbers {
  struct Range {
    double min, max;
  };
  double* (*at)(Config&);  ///< the first one; the others follow
  std::vector<Range> ranges;
};

/// One setting. Its default is the value in a default-constructed Config. Numbers outside [min, max] are errors.
struct Parameter {
  std::string name;  ///< `section.key`, as in the TOML file
  std::string text;
  std::variant<bool* (*)(Config&), int* (*)(Config&), double* (*)(Config&), std::string* (*)(Config&), NamedValues,
               Numbers, BusSignal* (*)(Config&), Choice>
      value;
  std::string unit{};  ///< empty: none
  double min = 0, max = 0;
  bool beside_file = false;  ///< a path, relative to the folder of the file that names it
};

const std::vector<Parameter>& parameters();

/// A checked configuration file; apply() overrides defaults and calibration with its settings.
class ConfigFile {
 public:
  /// A Choice is held as its index.
  using Value = std::variant<bool, int, double, std::string, std::vector<NamedValue>, std::vector<double>, BusSignal>;

  /// Fails if and only if the file cannot be read, is not TOML, names an unknown section or key, or holds a value of
  /// the wrong type or outside its range. `sets`: further settings in the syntax of set(), which override the file. An
  /// empty path reads no file.
  static Result<ConfigFile> read(const std::filesystem::path& path, const std::vector<std::string>& sets = {});
  static Result<ConfigFile> parse(std::string_view text, const std::string& name);
  /// Sets one setting, `section.key=value`, overriding earlier values. A text needs no quotes, numbers no brackets.
  /// Fails if and only if the setting does not exist, or the value has the wrong type or is out of range.
  Status set(const std::string& text);

  /// Writes the settings of the file, and no others, into `config`.
  void apply(Config& config) const;

 private:
  std::vector<std::pair<const Parameter*, Value>> settings_;
};

/// The text in quotes, as TOML writes it.
std::string toml_text(const std::string& text);
/// The configuration as a TOML file: each setting with text, unit and range above it.
std::string to_toml(const Config& config);

}  // namespace epiline

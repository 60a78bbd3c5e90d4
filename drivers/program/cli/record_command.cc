#include <fmt/format.h>

#include <string>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/record_lines.h"

namespace epiline {

namespace {

struct RecordArguments {
  RecordOptions record;
  std::filesystem::path config;
  std::vector<std::string> set;
  double keep_free_mb = 200;
  bool json = false, quiet = false;
};

nlohmann::ordered_json json_of(const RecordSummary& summary, const RecordArguments& options) {
  const RecordState& s = summary.last;
  const RecordCounts& c = s.counts;
  nlohmann::ordered_json root;
  root["schema"] = 1;
  root["folder"] = options.record.out.string();
  root["seconds"] = s.seconds;
  root["ended_by"] = kRecordEndNames[static_cast<std::size_t>(summary.end)];
  root["images"] = {{"written", c.images},
                    {"missed", c.images_missed},
                    {"unwritten", c.images_unwritten},
                    {"old", c.images_old},
                    {"resized", c.images_resized}};
  root["imu_samples"] = {{"written", c.readings}, {"missed", c.readings_missed}, {"unwritten", c.readings_unwritten}};
  root["bytes"] = s.bytes;
  root["compress_ms"] = s.compress_ms;
  root["write_ms"] = s.write_ms;
  auto& devices = root["devices"] = nlohmann::ordered_json::object();
  for (const DeviceRecord& device : summary.devices) {
    for (const DeviceCount& count : device.counts) devices[device.name][count.name] = count.value;
  }
  return root;
}

int record_command(RecordArguments& options) {
  const auto config = find_config(options.config);
  if (!config) return report(config.error());
  options.record.keep_free_bytes = static_cast<std::uint64_t>(1e6 * options.keep_free_mb);
  const bool says = !options.quiet && !options.json;
  const auto summary = record_and_say(*config, options.set, options.record, says);
  if (!summary) return report(summary.error());
  if (options.json) print_json(json_of(*summary, options));
  return kExitDone;
}

}  // namespace

void add_record(CLI::App& app, int& exit_code) {
  const auto [command, o] = add_command(
      app, exit_code, kFly, "record",
      "Record camera and IMU into an ASL folder, for `epiline calibrate` and `epiline replay`; needs no calibration",
      record_command);
  add_settings(*command, o->config, o->set,
               "configuration file (TOML) with devices; default: /etc/epiline/epiline.toml, else ./epiline.toml");
  command->add_option("--out", o->record.out, "folder to record into; a recording that is there is not replaced")
      ->required();
  command->add_option("--duration", o->record.duration_s, "end after this many seconds")->check(CLI::PositiveNumber);
  command->add_option("--keep-free", o->keep_free_mb, "end before the disk has less room than this")
      ->type_name("MB")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--json", o->json, "print the counts as JSON at the end, and nothing else");
  command->add_flag("--quiet", o->quiet, "print errors only");
}

}  // namespace epiline

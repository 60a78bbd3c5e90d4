#include "drivers/study/report/outputs.h"

#include "drivers/study/evaluate/odometry_file.h"
#include "drivers/study/report/own_parts.h"
#include "drivers/study/report/report.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/text/table.h"

namespace epiline {

Result<std::optional<TrajectoryErrors>> write_report(const FlightRecord& record, const std::filesystem::path& folder) {
  const std::optional<TrajectoryErrors> errors = errors_of(record);
  const ProgramInfo program = program_info();
  const Json stats = stats_json(record, errors, program);
  if (const Status s = write_text(folder / "stats.json", stats.dump(2) + "\n"); !s) return s.error();
  if (const Status s = write_text(folder / "report.html", report_html(record, errors, program)); !s) return s.error();
  if (record.tracker && record.tracker->own_cells.own.any()) {
    const std::string png = own_parts_png(record.tracker->own_cells);
    if (const Status s = write_text(folder / "own_parts.png", png); !s) return s.error();
  }
  return errors;
}

Result<std::optional<TrajectoryErrors>> write_outputs(const FlightRecord& record, const std::filesystem::path& folder) {
  if (const Status s = make_folder(folder); !s) return s.error();
  const ClaimedTrajectory odometry{trajectory_of(record), claims_of(record)};
  if (const Status s = write_text(folder / "trajectory.tum", tum_text(odometry.trajectory)); !s) return s.error();
  if (const Status s = write_text(folder / "odometry.csv", odometry_text(odometry)); !s) return s.error();
  if (record.realtime && record.realtime->predicted) {
    const std::string text = tum_text(record.realtime->predicted->trajectory);
    if (const Status s = write_text(folder / "odometry_imu_rate.tum", text); !s) return s.error();
  }
  if (const Status s = write_text(folder / "events.txt", events_text(record)); !s) return s.error();
  return write_report(record, folder);
}

}  // namespace epiline

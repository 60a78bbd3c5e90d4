// The program `epiline`: it wires things up and holds no logic of its own.
#include "drivers/program/cli/commands.h"

namespace epiline {
namespace {

void add_commands(CLI::App& app, int& exit_code) {
  add_run(app, exit_code);
  add_devices(app, exit_code);
  add_init(app, exit_code);
  add_check(app, exit_code);
  add_record(app, exit_code);
  add_board(app, exit_code);
  add_calibrate(app, exit_code);
  add_hil(app, exit_code);
  add_config(app, exit_code);
  add_dbc(app, exit_code);
  add_replay(app, exit_code);
  add_evaluate(app, exit_code);
  add_bench(app, exit_code);
}

}  // namespace
}  // namespace epiline

int main(int argc, char** argv) {
  return epiline::run_program(
      argc, argv, "epiline",
      "Visual-inertial odometry without a map: reads a camera and an IMU, estimates pose, velocity and their "
      "covariance.",
      epiline::add_commands);
}

// The program `epiline`: it wires things up and holds no logic of its own.
#include "drivers/program/cli/commands.h"

namespace epiline {
namespace {

void add_commands(CLI::App& app, int& exit_code) {
  for (const auto add : {add_run, add_devices, add_init, add_check, add_record, add_board, add_calibrate, add_hil,
                         add_config, add_dbc, add_replay, add_evaluate, add_bench})
    add(app, exit_code);
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

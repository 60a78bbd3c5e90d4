// The program `epiline-study`: what studies need and no vehicle does.
#include "drivers/laboratory/commands.h"

int main(int argc, char** argv) {
  return epiline::run_program(argc, argv, "epiline-study",
                              "Makes flights to study epiline with, and replays flights with other visual factors.",
                              [](CLI::App& app, int& exit_code) {
                                epiline::add_simulate(app, exit_code);
                                epiline::add_comparing_replay(app, exit_code);
                              });
}

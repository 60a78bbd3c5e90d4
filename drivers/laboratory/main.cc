// The program `epiline-study`: what studies need and no vehicle does.
#include "drivers/laboratory/simulate_command.h"
#include "drivers/program/cli/command_line.h"

int main(int argc, char** argv) {
  return epiline::run_program(argc, argv, "epiline-study", "Makes flights to study epiline with; `epiline` flies them.",
                              epiline::add_simulate);
}

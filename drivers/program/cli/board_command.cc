#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "drivers/program/cli/commands.h"
#include "drivers/study/calibrate/board_drawing.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace {

struct BoardArguments {
  AprilGrid grid{6, 8, 0.024, 0.3};
  double tag_mm = 24;
  std::filesystem::path out;
};

int write_board(BoardArguments arguments) {
  AprilGrid& grid = arguments.grid;
  grid.tag_m = 1e-3 * arguments.tag_mm;
  if (grid.tags() > kTagsOfFamily) {
    return report({ErrorKind::kUsage, "", 0, fmt::format("{} x {} tags", grid.columns, grid.rows),
                   fmt::format("at most {}", kTagsOfFamily)});
  }
  const auto pdf = board_pdf(grid);
  if (!pdf) return report(pdf.error());
  std::filesystem::path description = arguments.out;
  description.replace_extension(".yaml");
  if (const Status s = write_text(arguments.out, *pdf); !s) return report(s.error());
  if (const Status s = write_text(description, april_grid_yaml(grid)); !s) return report(s.error());
  fmt::print("board       {}: {} x {} tags, {:.1f} x {:.1f} mm; print it at 100 %, glue it to something flat\n",
             arguments.out.string(), grid.columns, grid.rows, 1e3 * grid.width_m(), 1e3 * grid.height_m());
  fmt::print("description {}: measure a tag on the paper, and correct tagSize\n", description.string());
  return kExitDone;
}

}  // namespace

void add_board(CLI::App& app, int& exit_code) {
  const auto arguments = std::make_shared<BoardArguments>();
  CLI::App* command = app.add_subcommand("board", "Write a calibration board to print, and its description");
  command->group(kFly);
  command->add_option("--out", arguments->out, "PDF file; the description goes to the same name with .yaml")
      ->required();
  command->add_option("--columns", arguments->grid.columns, "tags side by side")
      ->check(CLI::Range(1, 30))
      ->capture_default_str();
  command->add_option("--rows", arguments->grid.rows, "tags above each other")
      ->check(CLI::Range(1, 30))
      ->capture_default_str();
  command->add_option("--tag-mm", arguments->tag_mm, "side of a tag")
      ->check(CLI::Range(5.0, 1000.0))
      ->capture_default_str();
  command->add_option("--spacing", arguments->grid.spacing, "between tags, as a share of their side")
      ->check(CLI::Range(0.1, 1.0))
      ->capture_default_str();
  command->callback([arguments, &exit_code] { exit_code = write_board(*arguments); });
}

}  // namespace epiline

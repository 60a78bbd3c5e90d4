#include "drivers/study/calibrate/corner_views.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "pipeline/text/table.h"

namespace epiline {

Result<Target> read_target(const std::filesystem::path& path) {
  const auto text = read_text(path);
  if (!text) return text.error();
  const std::string expected = "corner of the board (id, x, y, z in metres)";
  const auto table = parse_table(*text, path.string(), TimeColumn::kNanoseconds, {4}, expected);
  if (!table) return table.error();
  const auto fail = [&](std::string found, std::string wanted) {
    return Error{ErrorKind::kUsage, path.string(), 0, std::move(found), std::move(wanted)};
  };
  Target target;
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const std::int64_t id = table->time_ns[i];
    const double* row = table->row(i);
    if (id < 0 || id > std::numeric_limits<std::uint32_t>::max())
      return fail(fmt::format("the id {}", id), "integers from 0 to 2^32-1");
    const Vec3 p(row[0], row[1], row[2]);
    if (!p.allFinite() || std::abs(p.z()) > 1e-9)
      return fail(fmt::format("corner {} outside the plane z = 0", id), "a flat board, its corners at z = 0");
    if (!target.emplace(static_cast<std::uint32_t>(id), p).second)
      return fail(fmt::format("corner {} twice", id), "each corner once");
  }
  if (target.size() < 4) return fail(fmt::format("{} corners", target.size()), "four corners at least");
  return target;
}

std::vector<CornerView> views_of(const AslDataset& dataset, const Target& target) {
  std::vector<CornerView> views;
  for (const TrackInstant& instant : dataset.instants) {
    if (!views.empty() && instant.stamp <= views.back().stamp) continue;
    CornerView view{instant.stamp, {}};
    for (std::size_t i = instant.first; i < instant.first + instant.count; ++i) {
      const TrackPoint& point = dataset.points[i];
      if (const auto corner = target.find(point.id); corner != target.end())
        view.corners.push_back({point.id, corner->second, Vec2(point.u, point.v)});
    }
    views.push_back(std::move(view));
  }
  return views;
}

}  // namespace epiline

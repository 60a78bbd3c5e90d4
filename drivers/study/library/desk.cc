#include "drivers/study/library/desk.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/study/evaluate/odometry_file.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/library/state.h"
#include "pipeline/text/table.h"

using epiline::Error;
using epiline::ErrorKind;
using epiline::Result;

struct epiline_desk_trajectory {
  epiline::ClaimedTrajectory odometry;
  std::string evaluation;
};

struct epiline_desk_flight {
  std::vector<epiline_state> states;
  epiline_desk_trajectory estimate;
  std::optional<epiline::Trajectory> truth;
  std::string statistics, tum, notes;
};

namespace {

thread_local std::string last_error;

class States final : public epiline::FlightObserver {
 public:
  explicit States(std::vector<epiline_state>& states) : states_(states) {}
  void take(const epiline::FrameOutcome& outcome) noexcept override { states_.push_back(epiline::state_of(outcome)); }

 private:
  std::vector<epiline_state>& states_;
};

/// The result of `make()`, or null with a message instead of an error or exception.
template <class Make>
auto guarded(Make&& make) noexcept {
  std::unique_ptr<std::remove_cvref_t<decltype(*make())>> result;
  try {
    auto made = make();
    if (made)
      result = std::make_unique<typename decltype(result)::element_type>(std::move(*made));
    else
      last_error = made.error().text();
  } catch (const std::exception& e) {
    last_error = e.what();
  }
  return result;
}

Result<epiline_desk_flight> flight_of(const epiline::ReplayOptions& what) {
  epiline_desk_flight flight;
  States states(flight.states);
  epiline::ReplayOptions options = what;
  options.observer = &states;
  const auto done = epiline::replay(options, [](std::size_t, std::size_t) {});
  if (!done) return done.error();
  const epiline::FlightRecord& record = done->record;
  flight.estimate.odometry = {epiline::trajectory_of(record), epiline::claims_of(record)};
  flight.truth = record.truth;
  flight.statistics = epiline::stats_json(record, epiline::errors_of(record), epiline::program_info()).dump();
  flight.tum = epiline::tum_text(flight.estimate.odometry.trajectory);
  for (const std::string& note : done->notes) flight.notes += note + "\n";
  return flight;
}

Result<epiline_desk_trajectory> trajectory_in(const char* path) {
  auto odometry = epiline::read_odometry(path);
  if (!odometry) return odometry.error();
  return epiline_desk_trajectory{std::move(*odometry), {}};
}

Result<epiline_desk_trajectory> trajectory_from(std::size_t count, const int64_t* ns, const double* p,
                                                const double* q) {
  epiline_desk_trajectory made;
  for (std::size_t i = 0; i < count; ++i, p += 3, q += 4) {
    const epiline::TimedPose pose{epiline::HostStamp{ns[i]}, {p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
    if (!add_pose(pose, made.odometry.trajectory))
      return Error{ErrorKind::kUsage, "pose " + std::to_string(i), 0, "a pose that is none, or out of order",
                   "finite numbers, a quaternion of length 1, and times that increase"};
  }
  return made;
}

Result<std::string> evaluation_of(const epiline_desk_trajectory& estimate, const epiline_desk_trajectory& reference,
                                  const char* align) {
  const auto alignment = epiline::alignment_from(align);
  if (!alignment)
    return Error{ErrorKind::kUsage, "", 0, "the alignment \"" + std::string(align) + "\"", "4dof, se3, sim3 or none"};
  const auto errors =
      epiline::evaluate(estimate.odometry.trajectory, reference.odometry.trajectory, estimate.odometry.claims);
  if (errors.poses == 0) return epiline::no_common_time("the estimate");
  return epiline::evaluation_json(errors, align).dump();
}

Result<epiline::GreyImage> image_in(const char* path) {
  const auto bytes = epiline::read_text(path);
  if (!bytes) return bytes.error();
  epiline::GreyImage image;
  if (!epiline::decode_image(reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size(), image))
    return Error{ErrorKind::kUsage, path, 0, "cannot be read as an image", "a complete PNG, JPEG or binary PGM"};
  return image;
}

}  // namespace

extern "C" {

const char* epiline_desk_error() { return last_error.c_str(); }

epiline_desk_flight* epiline_desk_replay(const char* dataset, const char* camera, const char* config,
                                         const char* const* sets, size_t set_count, double start_s, double duration_s) {
  return guarded([&] {
           epiline::ReplayOptions options;
           options.dataset = dataset;
           options.camera = camera;
           options.config_file = config;
           options.set.assign(sets, sets + set_count);
           options.start_s = start_s;
           if (duration_s > 0) options.duration_s = duration_s;
           return flight_of(options);
         })
      .release();
}
void epiline_desk_destroy_flight(epiline_desk_flight* flight) { delete flight; }

const epiline_state* epiline_desk_states(const epiline_desk_flight* flight, size_t* count) {
  *count = flight->states.size();
  return flight->states.data();
}
const char* epiline_desk_statistics(const epiline_desk_flight* flight) { return flight->statistics.c_str(); }
const char* epiline_desk_tum(const epiline_desk_flight* flight) { return flight->tum.c_str(); }
const char* epiline_desk_notes(const epiline_desk_flight* flight) { return flight->notes.c_str(); }

epiline_desk_trajectory* epiline_desk_estimate(const epiline_desk_flight* flight) {
  return new epiline_desk_trajectory(flight->estimate);
}
epiline_desk_trajectory* epiline_desk_truth(const epiline_desk_flight* flight) {
  return flight->truth ? new epiline_desk_trajectory{{*flight->truth, {}}, {}} : nullptr;
}

epiline_desk_trajectory* epiline_desk_read_trajectory(const char* path) {
  return guarded([&] { return trajectory_in(path); }).release();
}
epiline_desk_trajectory* epiline_desk_make_trajectory(size_t count, const int64_t* ns, const double* p,
                                                      const double* q) {
  return guarded([&] { return trajectory_from(count, ns, p, q); }).release();
}
void epiline_desk_destroy_trajectory(epiline_desk_trajectory* trajectory) { delete trajectory; }

size_t epiline_desk_poses(const epiline_desk_trajectory* trajectory) {
  return trajectory->odometry.trajectory.poses.size();
}
void epiline_desk_copy_poses(const epiline_desk_trajectory* trajectory, int64_t* ns, double* p, double* q) {
  for (const epiline::TimedPose& pose : trajectory->odometry.trajectory.poses) {
    *ns++ = pose.stamp.ns;
    p = std::copy_n(pose.p_WB.data(), 3, p);
    for (const double x : {pose.q_WB.w(), pose.q_WB.x(), pose.q_WB.y(), pose.q_WB.z()}) *q++ = x;
  }
}

const char* epiline_desk_evaluate(epiline_desk_trajectory* estimate, const epiline_desk_trajectory* reference,
                                  const char* align) {
  const auto made = guarded([&] { return evaluation_of(*estimate, *reference, align); });
  if (made == nullptr) return nullptr;
  estimate->evaluation = *made;
  return estimate->evaluation.c_str();
}

int epiline_desk_read_image(const char* path, uint8_t* pixels, int* width, int* height) {
  const auto image = guarded([&] { return image_in(path); });
  if (image == nullptr) return -1;
  if (pixels != nullptr && (image->width != *width || image->height != *height)) return -1;
  *width = image->width;
  *height = image->height;
  if (pixels != nullptr) std::copy(image->pixels.begin(), image->pixels.end(), pixels);
  return 0;
}

}  // extern "C"

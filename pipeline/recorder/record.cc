#include "pipeline/recorder/record.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "pipeline/config/asl.h"
#include "pipeline/text/output_files.h"
#include "pipeline/text/table.h"
#include "pipeline/text/text.h"
#include "pipeline/text/trajectory.h"

namespace epiline {
namespace fs = std::filesystem;

namespace {

constexpr const char* kStatesHeader =
    "#timestamp [ns],serial,p_x [m],p_y,p_z,q_w,q_x,q_y,q_z,v_x [m s^-1],v_y,v_z,bg_x [rad s^-1],bg_y,bg_z,"
    "ba_x [m s^-2],ba_y,ba_z,sigma_p_x [m],sigma_p_y,sigma_p_z,sigma_theta_x [rad],sigma_theta_y,sigma_theta_z,"
    "sigma_v_x [m s^-1],sigma_v_y,sigma_v_z,time_offset [s],resets,health,reasons,quality,tracks,has_pose,solved,"
    "keyframe\n";

template <class T>
T object_at(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

/// The files of a record while it is being written.
class RecordFiles {
 public:
  RecordFiles(const fs::path& root, const RecordOrder& order, const RecordedRun& run)
      : root_(root),
        order_(order),
        run_(run),
        imu_(root / "mav0/imu0/data.csv"),
        tracks_(root / "mav0/cam0/tracks.csv"),
        states_(root / "states.csv"),
        events_(root / "events.txt") {
    imu_.append(kAslImuHeader);
    tracks_.append(kAslTracksHeader);
    states_.append(kStatesHeader);
  }

  void add(const Tape::Record& record) {
    const std::byte* const at = record.bytes.data();
    if (object_at<HostStamp>(at) < order_.from) return;  // all records begin with their time
    switch (static_cast<RecordKind>(record.kind)) {
      case RecordKind::kImu:
        return append_asl_imu(imu_text_, object_at<ImuSample>(at));
      case RecordKind::kState:
        return add_state(object_at<RecordedState>(at));
      case RecordKind::kTracks:
        return add_tracks(at);
      case RecordKind::kImage:
        return add_image(at);
      case RecordKind::kEvent:
        return add_event(object_at<Event>(at));
      case RecordKind::kWheel:
        return append_asl_wheel(wheel_text_, object_at<WheelSample>(at));
      case RecordKind::kHeight:
        return add_height(object_at<HeightSample>(at));
    }
  }

  /// What was added goes into the files.
  void flush() {
    const auto move = [](std::string& text, OutputFile& file) {
      file.append(text);
      text.clear();
    };
    move(imu_text_, imu_);
    move(tracks_text_, tracks_);
    move(states_text_, states_);
    move(events_text_, events_);
  }

  /// Fails with the first failure of all files.
  Status close() {
    flush();
    for (OutputFile* file : {&imu_, &tracks_, &states_, &events_}) close(*file);
    for (std::size_t c = 0; c < image_lists_.size(); ++c) write_table(folder_of(c), kAslImagesHeader, image_lists_[c]);
    write_table("wheel0", kAslWheelHeader, wheel_text_);
    for (const AslHeightTable& table : kAslHeightTables)
      write_table(table.folder, table.header, height_texts_[static_cast<std::size_t>(table.kind)]);
    const std::string comment = fmt::format("flight recorder, record {}, written at {:.3f} s", order_.number,
                                            1e-9 * static_cast<double>(order_.now.ns));
    write("mav0/cam0/sensor.yaml", asl_camera(run_.camera, run_.image_rate_hz, comment));
    for (std::size_t c = 1; c < image_lists_.size(); ++c)
      if (!image_lists_[c].empty())
        write("mav0/" + folder_of(c) + "/sensor.yaml", asl_camera(*run_.others[c - 1], run_.image_rate_hz, comment));
    write("mav0/imu0/sensor.yaml", asl_imu(run_.imu));
    write("config.toml", run_.config_toml);
    write("trajectory.tum", tum_text(trajectory_));
    return failed_ ? Status(*failed_) : Done{};
  }

  int failure() const { return failure_; }

 private:
  void close(OutputFile& file) {
    const Status s = file.close();
    if (s || failed_) return;
    failed_ = s.error();
    failure_ = file.failure();
  }
  /// Nothing once something has failed.
  void write(const std::string& name, const std::string& text) {
    if (failed_) return;
    OutputFile file(root_ / name);
    file.append(text);
    close(file);
  }

  /// Of a sensor that sent anything.
  void write_table(const std::string& folder, const char* header, const std::string& rows) {
    if (rows.empty() || failed_) return;
    if (const Status s = make_folder(root_ / "mav0" / folder); !s)
      failed_ = s.error();
    else
      write("mav0/" + folder + "/data.csv", header + rows);
  }

  void add_height(const HeightSample& s) {
    if (const auto kind = static_cast<std::size_t>(s.kind); kind < kHeightKinds)
      append_asl_height(height_texts_[kind], s);
  }

  void add_state(const RecordedState& s) {
    Text out;
    out.print("{},{}", s.stamp.ns, s.serial);
    const auto numbers = [&](const auto& values) {
      for (const double v : values) out.print(",{}", v);
    };
    numbers(s.p_WB_m);
    numbers(s.q_WB);
    for (const auto* v : {&s.v_WB_m_s, &s.gyroscope_bias_rad_s, &s.accelerometer_bias_m_s2, &s.sigma_p_m,
                          &s.sigma_theta_rad, &s.sigma_v_m_s})
      numbers(*v);
    out.print(",{},{},{},{},{},{},{:d},{:d},{:d}\n", s.time_offset_s, s.reset_counter, s.state, s.reasons, s.quality,
              s.tracks, s.has_pose, s.solved, s.keyframe);
    states_text_ += out;
    if (!s.has_pose) return;
    const auto& q = s.q_WB;
    trajectory_.poses.push_back(
        {s.stamp, Vec3(s.p_WB_m[0], s.p_WB_m[1], s.p_WB_m[2]), Eigen::Quaterniond(q[0], q[1], q[2], q[3])});
  }

  void add_tracks(const std::byte* at) {
    const auto header = object_at<RecordedTracksHeader>(at);
    Text out;
    if (header.count == 0) out.print("{},0,nan,nan\n", header.stamp.ns);  // an image all the same
    for (std::uint64_t i = 0; i < header.count; ++i) {
      const auto p = object_at<RecordedPoint>(at + sizeof header + i * sizeof(RecordedPoint));
      out.print("{},{},{},{}\n", header.stamp.ns, p.id, p.u, p.v);
    }
    tracks_text_ += out;
  }

  static std::string folder_of(std::size_t camera) { return "cam" + std::to_string(camera); }

  void add_image(const std::byte* at) {
    if (failed_) return;
    const auto header = object_at<RecordedImageHeader>(at);
    const auto camera = static_cast<std::size_t>(header.camera);
    Frame frame;
    frame.stamp = header.stamp;
    frame.data = reinterpret_cast<const std::uint8_t*>(at + sizeof header);
    frame.width = frame.stride = header.width;
    frame.height = header.height;
    const std::string file = std::to_string(header.stamp.ns) + ".png";
    write("mav0/" + folder_of(camera) + "/data/" + file, run_.png(frame));
    append_asl_image(image_lists_[camera], header.stamp, file);
  }

  void add_event(const Event& event) {
    char line[256];
    events_text_.append(line, format_event(event, line)) += '\n';
  }

  fs::path root_;
  const RecordOrder& order_;
  const RecordedRun& run_;
  OutputFile imu_, tracks_, states_, events_;
  std::string imu_text_, tracks_text_, states_text_, events_text_, wheel_text_;
  std::array<std::string, kMostOthers + 1> image_lists_;  ///< by camera
  std::array<std::string, kHeightKinds> height_texts_;
  Trajectory trajectory_;
  std::optional<Error> failed_;
  int failure_ = 0;  ///< errno of that
};

/// Reads the segments oldest first, so that recording soon has room again.
void read(Tape& tape, const Tape::Range& range, RecordFiles& files) {
  for (std::uint64_t segment = range.from; segment < range.to; ++segment) {
    tape.each(segment, [&](const Tape::Record& record) { files.add(record); });
    tape.done_before(segment + 1);
    files.flush();
  }
  tape.done();
}

}  // namespace

RecordedState recorded_state(const FrameOutcome& outcome) noexcept {
  const Odometry& o = outcome.odometry;
  RecordedState s;
  s.stamp = outcome.stamp;
  s.serial = outcome.serial;
  s.p_WB_m = o.p_WB_m;
  s.q_WB = o.q_WB;
  s.v_WB_m_s = o.v_WB_m_s;
  s.gyroscope_bias_rad_s = o.gyroscope_bias_rad_s;
  s.accelerometer_bias_m_s2 = o.accelerometer_bias_m_s2;
  const auto sigma = [&](std::size_t i) { return std::sqrt(std::max(0.0, o.covariance[17 * i])); };
  for (std::size_t i = 0; i < 3; ++i) {
    s.sigma_p_m[i] = sigma(i);
    s.sigma_theta_rad[i] = sigma(i + 3);
    s.sigma_v_m_s[i] = sigma(i + 6);
  }
  s.time_offset_s = o.time_offset_s;
  s.reset_counter = o.reset_counter;
  s.reasons = o.health.reasons;
  s.quality = o.health.quality;
  s.tracks = outcome.tracks;
  s.state = static_cast<std::uint8_t>(o.health.state);
  s.has_pose = outcome.result.has_pose;
  s.solved = outcome.result.solved;
  s.keyframe = outcome.keyframe;
  return s;
}

Status write_record(const RecordOrder& order, const RecordedRun& run, Tape& samples, Tape* images, const fs::path& name,
                    int& failure) {
  // whatever happens, recording goes on
  struct GiveBack {
    Tape *samples, *images;
    ~GiveBack() {
      samples->done();
      if (images != nullptr) images->done();
    }
  } const give_back{&samples, images};
  auto folder = PartialFolder::create(name, {"mav0/cam0/data", "mav0/imu0"});
  if (!folder) return folder.error();
  for (std::size_t i = 0; i < kMostOthers && images != nullptr; ++i) {
    if (!run.others[i]) continue;
    if (Status s = make_folder(folder->root() / fmt::format("mav0/cam{}/data", i + 1)); !s) return s;
  }
  RecordFiles files(folder->root(), order, run);
  read(samples, order.samples, files);
  if (images != nullptr) read(*images, order.images, files);
  const Status written = files.close();
  failure = files.failure();
  if (!written) return written;
  if (Status s = folder->finish(); !s) return s;
  sync_folder(name.parent_path());
  return Done{};
}

}  // namespace epiline

#pragma once
// A participant of DDS that writes messages which are serialised already: Cyclone DDS, loaded when the first one opens.
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

/// A topic of ROS 2, as it is called on DDS.
struct DdsTopic {
  const char* name;  ///< "rt/odometry"
  const char* type;  ///< "nav_msgs::msg::dds_::Odometry_"
  const char* hash;  ///< of the type: REP 2016
};

class DdsParticipant {
 public:
  static constexpr int kMostDomain = 232;  ///< the ports of those after it are not there

  DdsParticipant() = default;
  ~DdsParticipant() { close(); }
  DdsParticipant(const DdsParticipant&) = delete;
  DdsParticipant& operator=(const DdsParticipant&) = delete;

  /// Joins the domain. ErrorKind::kUsage: there is no Cyclone DDS, in this build or on this computer; otherwise the
  /// domain can't be joined now. Starts threads, with the caller's niceness.
  Status open(int domain, std::span<const DdsTopic> topics);
  /// Waits up to a second for readers that have not acknowledged everything.
  void close() noexcept;
  /// `message`: CDR behind its header of four bytes. `topic`: from 0. False: nobody will get it. Waits at most 0.1 s.
  bool write(std::size_t topic, std::string_view message);

 private:
  struct Writer {
    std::int32_t entity;
    void* type;
  };
  std::int32_t entity_ = 0;  ///< 0: not open
  std::vector<Writer> writers_;
};

}  // namespace epiline

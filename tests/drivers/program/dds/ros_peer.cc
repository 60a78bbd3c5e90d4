// A stranger to epiline that reads what ROS 2's nodes would read: Fast DDS (the usual middleware of ROS 2) and its own
// CDR, with the fields in the order of ROS 2's definitions: https://github.com/ros2/common_interfaces (std_msgs/Header,
// nav_msgs/Odometry, geometry_msgs, diagnostic_msgs) and https://github.com/ros2/geometry2 (tf2_msgs/TFMessage).
//
// usage: ros_peer DOMAIN SECONDS [best-effort]. Prints a line for each message, and "found TOPIC TYPE USER_DATA" for
// each writer in the domain.
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <iomanip>
#include <sstream>
#include <string>
#include <thread>

namespace {

using eprosima::fastcdr::Cdr;
using namespace eprosima::fastdds::dds;  // NOLINT

/// Reads fields one after the other, and writes them down.
class Fields {
 public:
  explicit Fields(Cdr& in) : in_(in) { out_ << std::setprecision(17); }
  std::string text() const { return out_.str(); }

  template <class T>
  T number() {
    T value{};
    in_ >> value;
    return value;
  }
  void string() {
    std::string value;
    in_ >> value;
    out_ << ' ' << std::quoted(value);
  }
  void float64s(int n) {
    for (int i = 0; i < n; ++i) out_ << ' ' << number<double>();
  }
  void stamp() {  // builtin_interfaces/Time: int32 sec, uint32 nanosec
    const auto sec = number<std::int32_t>();
    const auto nanosec = number<std::uint32_t>();
    out_ << ' ' << sec << '.' << std::setfill('0') << std::setw(9) << nanosec;
  }
  void header() {  // std_msgs/Header
    stamp();
    string();
  }
  void odometry() {
    header();
    string();      // child_frame_id
    float64s(7);   // pose.pose: position x y z, orientation x y z w
    float64s(36);  // pose.covariance
    float64s(6);   // twist.twist: linear, angular
    float64s(36);  // twist.covariance
  }
  void transforms() {
    for (auto n = number<std::uint32_t>(); n > 0; --n) {  // geometry_msgs/TransformStamped
      header();
      string();     // child_frame_id
      float64s(7);  // transform: translation x y z, rotation x y z w
    }
  }
  void diagnostics() {
    header();
    for (auto n = number<std::uint32_t>(); n > 0; --n) {  // diagnostic_msgs/DiagnosticStatus
      out_ << ' ' << int{number<std::uint8_t>()};         // level
      string();                                           // name
      string();                                           // message
      string();                                           // hardware_id
      for (auto values = number<std::uint32_t>(); values > 0; --values) {
        string();  // key
        string();  // value
      }
    }
  }

 private:
  Cdr& in_;
  std::ostringstream out_;
};

/// Its data are lines of text.
class Type final : public TopicDataType {
 public:
  Type(const char* name, void (Fields::*read)()) : read_(read) {
    setName(name);
    m_typeSize = 4096;
  }
  bool serialize(void*, eprosima::fastrtps::rtps::SerializedPayload_t*) override { return false; }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    Cdr in(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    try {
      in.read_encapsulation();
      Fields fields(in);
      (fields.*read_)();
      const std::size_t left = payload->length - in.getSerializedDataLength();
      *static_cast<std::string*>(data) = fields.text() + (left < 4 ? "" : " and bytes that belong to nothing");
    } catch (const eprosima::fastcdr::exception::Exception& e) {
      *static_cast<std::string*>(data) = std::string(" unreadable: ") + e.what();
    }
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0U; };
  }
  void* createData() override { return new std::string; }
  void deleteData(void* data) override { delete static_cast<std::string*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }

 private:
  void (Fields::*read_)();
};

struct Printer final : DataReaderListener {
  void on_data_available(DataReader* reader) override {
    std::string line;
    SampleInfo info;
    while (reader->take_next_sample(&line, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data) std::printf("%s%s\n", reader->get_topicdescription()->get_name().c_str(), line.c_str());
  }
};

struct Finder final : DomainParticipantListener {
  void on_publisher_discovery(DomainParticipant*, eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override {
    if (info.status != eprosima::fastrtps::rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) return;
    const auto& user = info.info.m_qos.m_userData.getValue();
    std::printf("found %s %s %s\n", info.info.topicName().c_str(), info.info.typeName().c_str(),
                std::string(user.begin(), user.end()).c_str());
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  Finder finder;
  DomainParticipant* const participant = DomainParticipantFactory::get_instance()->create_participant(
      domain, PARTICIPANT_QOS_DEFAULT, &finder, StatusMask::none());
  if (participant == nullptr) return 1;
  DataReaderQos qos = DATAREADER_QOS_DEFAULT;
  qos.reliability().kind = argc > 3 ? BEST_EFFORT_RELIABILITY_QOS : RELIABLE_RELIABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 100;
  Printer printer;
  Subscriber* const subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  struct Wanted {
    const char *topic, *type;
    void (Fields::*read)();
  };
  for (const Wanted& w :
       {Wanted{"rt/odometry", "nav_msgs::msg::dds_::Odometry_", &Fields::odometry},
        Wanted{"rt/tf", "tf2_msgs::msg::dds_::TFMessage_", &Fields::transforms},
        Wanted{"rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_", &Fields::diagnostics}}) {
    TypeSupport(new Type(w.type, w.read)).register_type(participant);
    subscriber->create_datareader(participant->create_topic(w.topic, w.type, TOPIC_QOS_DEFAULT), qos, &printer);
  }
  std::puts("listening");
  std::this_thread::sleep_for(std::chrono::duration<double>(std::atof(argv[2])));
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
}

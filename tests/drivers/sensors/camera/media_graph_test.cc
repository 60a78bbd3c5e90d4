// The media graph of a made-up board: a sensor, a CSI receiver with two outputs, and their video nodes. Against the
// kernel's own graph of vimc: tests/hardware/vimc_test.cc.
#include "drivers/sensors/camera/media_graph.h"

#include <gtest/gtest.h>
#include <linux/media-bus-format.h>
#include <linux/v4l2-controls.h>
#include <linux/v4l2-subdev.h>
#include <linux/videodev2.h>
#include <sys/sysmacros.h>

#include <cstring>
#include <vector>

#include "tests/drivers/fake_kernel.h"

namespace epiline {
namespace {

constexpr unsigned kMajor = 81;
constexpr std::uint32_t kEnabled = MEDIA_LNK_FL_ENABLED;

class FakeGraph final : public test::FakeFile {
 public:
  /// Returns its id. `minor`: of its device file; 0: it has none.
  std::uint32_t add_entity(const char* name, std::uint32_t function, unsigned minor) {
    media_v2_entity entity{};
    entity.id = next_id++;
    entity.function = function;
    std::strncpy(entity.name, name, sizeof entity.name - 1);
    entities.push_back(entity);
    if (minor == 0) return entity.id;
    media_v2_interface interface {};
    interface.id = next_id++;
    interface.intf_type = function == MEDIA_ENT_F_IO_V4L ? MEDIA_INTF_T_V4L_VIDEO : MEDIA_INTF_T_V4L_SUBDEV;
    interface.devnode = {kMajor, minor};
    interfaces.push_back(interface);
    links.push_back({next_id++, interface.id, entity.id, MEDIA_LNK_FL_INTERFACE_LINK | MEDIA_LNK_FL_ENABLED, {}});
    return entity.id;
  }
  std::uint32_t add_pad(std::uint32_t entity, std::uint32_t index, bool is_source) {
    const std::uint32_t flags = is_source ? MEDIA_PAD_FL_SOURCE : MEDIA_PAD_FL_SINK;
    pads.push_back({next_id++, entity, flags, index, {}});
    return pads.back().id;
  }
  std::uint32_t add_link(std::uint32_t source, std::uint32_t sink, std::uint32_t flags) {
    links.push_back({next_id++, source, sink, flags, {}});
    return links.back().id;
  }
  bool is_enabled(std::uint32_t id) const {
    for (const media_v2_link& link : links)
      if (link.id == id) return (link.flags & kEnabled) != 0;
    return false;
  }

  int ioctl(unsigned long request, void* argument) override {
    if (request == MEDIA_IOC_G_TOPOLOGY) return give(*static_cast<media_v2_topology*>(argument));
    if (request == MEDIA_IOC_SETUP_LINK) return set(*static_cast<const media_link_desc*>(argument));
    return test::refuse(ENOTTY);
  }

  std::vector<media_v2_entity> entities;
  std::vector<media_v2_interface> interfaces;
  std::vector<media_v2_pad> pads;
  std::vector<media_v2_link> links;
  std::uint32_t next_id = 1;
  int setup_error = 0;

 private:
  /// Returns how many there are.
  template <class Item>
  static __u32 copy(const std::vector<Item>& items, __u64 into) {
    if (into != 0) std::copy(items.begin(), items.end(), reinterpret_cast<Item*>(into));
    return static_cast<__u32>(items.size());
  }
  int give(media_v2_topology& topology) {
    topology.num_entities = copy(entities, topology.ptr_entities);
    topology.num_interfaces = copy(interfaces, topology.ptr_interfaces);
    topology.num_pads = copy(pads, topology.ptr_pads);
    topology.num_links = copy(links, topology.ptr_links);
    return 0;
  }
  std::uint32_t id_of(const media_pad_desc& wanted) const {
    for (const media_v2_pad& pad : pads)
      if (pad.entity_id == wanted.entity && pad.index == wanted.index) return pad.id;
    return 0;
  }
  int set(const media_link_desc& wish) {
    if (setup_error != 0) return test::refuse(setup_error);
    for (media_v2_link& link : links) {
      if (link.source_id != id_of(wish.source) || link.sink_id != id_of(wish.sink)) continue;
      link.flags = (link.flags & ~kEnabled) | wish.flags;
      return 0;
    }
    return test::refuse(EINVAL);
  }
};

class FakeSubDevice final : public test::FakeFile {
 public:
  int ioctl(unsigned long request, void* argument) override {
    switch (request) {
      case VIDIOC_SUBDEV_S_FMT: {
        auto& wish = *static_cast<v4l2_subdev_format*>(argument);
        if (format_error != 0) return test::refuse(format_error);
        if (most_width != 0) wish.format.width = std::min(wish.format.width, most_width);
        width = wish.format.width, height = wish.format.height;
        return 0;
      }
      case VIDIOC_SUBDEV_G_FMT: {
        auto& format = static_cast<v4l2_subdev_format*>(argument)->format;
        format.width = width, format.height = height;
        return 0;
      }
      case VIDIOC_SUBDEV_ENUM_MBUS_CODE: {
        auto& code = *static_cast<v4l2_subdev_mbus_code_enum*>(argument);
        if (code.index >= codes.size()) return test::refuse(EINVAL);
        code.code = codes[code.index];
        return 0;
      }
      case VIDIOC_G_EXT_CTRLS:
        return get(*static_cast<v4l2_ext_controls*>(argument)->controls);
      case VIDIOC_S_EXT_CTRLS:
        blank_rows = static_cast<const v4l2_ext_controls*>(argument)->controls->value;
        return 0;
      case VIDIOC_QUERY_EXT_CTRL: {
        auto& range = *static_cast<v4l2_query_ext_ctrl*>(argument);
        range.minimum = 30, range.maximum = 10'000;
        return 0;
      }
      case VIDIOC_SUBDEV_S_FRAME_INTERVAL:
        if (interval.denominator == 0) return test::refuse(ENOTTY);
        interval = static_cast<const v4l2_subdev_frame_interval*>(argument)->interval;
        return 0;
      case VIDIOC_SUBDEV_G_FRAME_INTERVAL:
        static_cast<v4l2_subdev_frame_interval*>(argument)->interval = interval;
        return interval.denominator != 0 ? 0 : test::refuse(ENOTTY);
      default:
        return test::refuse(ENOTTY);
    }
  }

  std::vector<std::uint32_t> codes{MEDIA_BUS_FMT_Y10_1X10, MEDIA_BUS_FMT_Y8_1X8};
  std::uint32_t width = 1456, height = 1088, most_width = 0;
  int format_error = 0;
  std::int64_t pixel_rate = 0;  ///< 0: it has no controls
  std::int32_t blank_rows = 30;
  v4l2_fract interval{0, 0};  ///< 0: it has none

 private:
  int get(v4l2_ext_control& control) const {
    if (pixel_rate == 0) return test::refuse(EINVAL);
    if (control.id == V4L2_CID_PIXEL_RATE) return control.value64 = pixel_rate, 0;
    control.value = control.id == V4L2_CID_HBLANK ? 144 : blank_rows;
    return 0;
  }
};

class FakeText final : public test::FakeFile {
 public:
  explicit FakeText(std::string text) : text_(std::move(text)) {}
  ssize_t read(void* into, std::size_t size) override {
    const std::size_t count = std::min(size, text_.size());
    std::copy_n(text_.begin(), count, static_cast<char*>(into));
    return static_cast<ssize_t>(count);
  }

 private:
  std::string text_;
};

/// sensor -> receiver -> node; receiver -> other node. Sub-devices have the minors 11 and 12, the nodes 1 and 2.
class MediaGraphTest : public testing::Test {
 protected:
  MediaGraphTest() {
    const auto webcam = std::make_shared<FakeGraph>();
    webcam->add_entity("webcam", MEDIA_ENT_F_IO_V4L, 7);
    kernel.devices["/dev/media0"] = webcam;
    kernel.devices["/dev/media2"] = board;
    const std::uint32_t sensor_id = board->add_entity("imx296 4-001a", MEDIA_ENT_F_CAM_SENSOR, 11),
                        receiver_id = board->add_entity("csi2", MEDIA_ENT_F_VID_IF_BRIDGE, 12),
                        node_id = board->add_entity("csi2_ch0", MEDIA_ENT_F_IO_V4L, 1),
                        other_id = board->add_entity("csi2_ch1", MEDIA_ENT_F_IO_V4L, 2);
    sensor_pad = board->add_pad(sensor_id, 0, true);
    receiver_in = board->add_pad(receiver_id, 0, false);
    receiver_out = board->add_pad(receiver_id, 1, true);
    const std::uint32_t node = board->add_pad(node_id, 0, false), other = board->add_pad(other_id, 0, false);
    board->add_link(sensor_pad, receiver_in, kEnabled);
    to_node = board->add_link(receiver_out, node, 0);
    to_other = board->add_link(receiver_out, other, kEnabled);
    add_sub_device(11, "v4l-subdev0", sensor);
    add_sub_device(12, "v4l-subdev1", receiver);
  }
  void add_sub_device(int minor, const std::string& name, const std::shared_ptr<FakeSubDevice>& device) {
    kernel.devices["/sys/dev/char/81:" + std::to_string(minor) + "/uevent"] =
        std::make_shared<FakeText>("MAJOR=81\nMINOR=" + std::to_string(minor) + "\nDEVNAME=" + name + "\n");
    kernel.devices["/dev/" + name] = device;
  }
  void add_second_sensor() {
    const std::uint32_t id = board->add_entity("ov9281 6-0060", MEDIA_ENT_F_CAM_SENSOR, 13);
    board->add_link(board->add_pad(id, 0, true), receiver_in, 0);
    add_sub_device(13, "v4l-subdev2", std::make_shared<FakeSubDevice>());
  }
  void find(const char* wanted) {
    ASSERT_TRUE(graph.open(makedev(kMajor, 1)));
    const DeviceTrouble trouble = graph.find_way(wanted);
    ASSERT_FALSE(trouble) << error_of(trouble, "").text();
    ASSERT_TRUE(graph.has_way());
  }

  test::FakeKernel kernel;
  std::shared_ptr<FakeGraph> board = std::make_shared<FakeGraph>();
  std::shared_ptr<FakeSubDevice> sensor = std::make_shared<FakeSubDevice>(),
                                 receiver = std::make_shared<FakeSubDevice>();
  std::uint32_t sensor_pad = 0, receiver_in = 0, receiver_out = 0, to_node = 0, to_other = 0;
  MediaGraph graph{kernel};
};

TEST_F(MediaGraphTest, IsTheOneThatTheVideoNodeBelongsTo) {
  EXPECT_FALSE(graph.open(0));
  EXPECT_FALSE(graph.open(makedev(1, kMajor))) << "another device with the numbers the other way round";
  EXPECT_FALSE(graph.open(makedev(kMajor, 99)));
  EXPECT_EQ(kernel.open_files(), 0U);
  ASSERT_TRUE(graph.open(makedev(kMajor, 1)));
  EXPECT_STREQ(graph.node_name(), "csi2_ch0");
  EXPECT_EQ(kernel.open_files(), 1U);
  ASSERT_TRUE(graph.open(makedev(kMajor, 7)));
  EXPECT_STREQ(graph.node_name(), "webcam");
  EXPECT_FALSE(graph.find_way("")) << "a USB camera has no sensor to set up";
  EXPECT_FALSE(graph.has_way());
  graph.close();
  EXPECT_EQ(kernel.open_files(), 0U);
}

TEST_F(MediaGraphTest, AGraphTooLargeIsNotRead) {
  for (int i = 0; i < 100; ++i) board->add_entity("more", MEDIA_ENT_F_PROC_VIDEO_SCALER, 0);
  EXPECT_FALSE(graph.open(makedev(kMajor, 1)));
  EXPECT_EQ(kernel.open_files(), 0U);
}

TEST_F(MediaGraphTest, OpensTheSubDevicesOnTheWayAndClosesThem) {
  for (int round = 0; round < 3; ++round) {
    find("");
    EXPECT_STREQ(graph.sensor_name(), "imx296 4-001a");
    ASSERT_EQ(graph.sub_devices(), 2U);
    EXPECT_NE(graph.sub_device(0), graph.sub_device(1));
    EXPECT_EQ(kernel.open_files(), 3U) << "and the graph";
  }
  EXPECT_EQ(graph.sensor_code(0), static_cast<std::uint32_t>(MEDIA_BUS_FMT_Y10_1X10));
  EXPECT_EQ(graph.sensor_code(1), static_cast<std::uint32_t>(MEDIA_BUS_FMT_Y8_1X8));
  EXPECT_EQ(graph.sensor_code(2), 0U);
  graph.close();
  EXPECT_EQ(graph.sub_devices(), 0U);
  EXPECT_EQ(kernel.open_files(), 0U);
}

TEST_F(MediaGraphTest, ASubDeviceThatCannotBeOpenedIsNamedAndTheOthersClosed) {
  kernel.devices.erase("/dev/v4l-subdev1");
  ASSERT_TRUE(graph.open(makedev(kMajor, 1)));
  const DeviceTrouble trouble = graph.find_way("");
  EXPECT_EQ(trouble.error, ENOENT);
  EXPECT_FALSE(graph.has_way());
  EXPECT_EQ(kernel.open_files(), 1U);
}

TEST_F(MediaGraphTest, SaysWhichSensorsThereAre) {
  add_second_sensor();
  const auto error = [&](const char* wanted) {
    EXPECT_TRUE(graph.open(makedev(kMajor, 1)));
    return error_of(graph.find_way(wanted), "cam").text();
  };
  const std::string both = "\"imx296 4-001a\", \"ov9281 6-0060\"";
  EXPECT_EQ(error(""), "cam: several sensors \"\" lead to csi2_ch0 [camera.sensor]; expected " + both);
  EXPECT_EQ(error("imx477"), "cam: no sensor \"imx477\" leads to csi2_ch0 [camera.sensor]; expected " + both);
  find("ov9281");
  EXPECT_STREQ(graph.sensor_name(), "ov9281 6-0060");
}

TEST_F(MediaGraphTest, LinksTheWayAndUnlinksWhatMeetsIt) {
  find("");
  EXPECT_FALSE(graph.link());
  EXPECT_TRUE(board->is_enabled(to_node));
  EXPECT_FALSE(board->is_enabled(to_other));
  board->setup_error = EBUSY;
  for (media_v2_link& link : board->links)
    if (link.id == to_node) link.flags = 0;
  find("");
  const DeviceTrouble trouble = graph.link();
  EXPECT_EQ(trouble.error, EBUSY);
  EXPECT_STREQ(trouble.found, "cannot enable the link from csi2 to csi2_ch0");
}

TEST_F(MediaGraphTest, EachPadGetsWhatTheOneBeforeItGives) {
  find("");
  BusFormat at_node;
  const BusFormat wanted{MEDIA_BUS_FMT_Y10_1X10, 1456, 1088};
  EXPECT_FALSE(graph.set_format(wanted, at_node));
  EXPECT_EQ(at_node, wanted);
  sensor->most_width = 728;  // it gives less than was asked
  EXPECT_FALSE(graph.set_format(wanted, at_node));
  EXPECT_EQ(at_node.width, 728);
  EXPECT_EQ(receiver->width, 728U);
  receiver->most_width = 640;  // which the receiver does not take
  EXPECT_FALSE(graph.set_format(wanted, at_node));
  EXPECT_EQ(at_node.code, 0U);
  receiver->format_error = EBUSY;
  const DeviceTrouble trouble = graph.set_format(wanted, at_node);
  EXPECT_EQ(trouble.error, EBUSY);
  EXPECT_STREQ(trouble.found, "csi2");
}

// An output of the receiver also feeds a unit for statistics by a link that cannot be disabled. The kernel starts the
// stream only if that one is set up alike; what it would give goes nowhere.
TEST_F(MediaGraphTest, ABranchThatCannotBeCutIsSetUpAlike) {
  const std::uint32_t statistics_id = board->add_entity("stats", MEDIA_ENT_F_PROC_VIDEO_STATISTICS, 13),
                      file_id = board->add_entity("stats_file", MEDIA_ENT_F_IO_V4L, 3),
                      in = board->add_pad(statistics_id, 0, false), out = board->add_pad(statistics_id, 1, true);
  board->add_link(receiver_out, in, MEDIA_LNK_FL_ENABLED | MEDIA_LNK_FL_IMMUTABLE);
  const std::uint32_t to_file = board->add_link(out, board->add_pad(file_id, 0, false), kEnabled);
  const auto statistics = std::make_shared<FakeSubDevice>();
  add_sub_device(13, "v4l-subdev2", statistics);
  find("");
  EXPECT_FALSE(graph.link());
  EXPECT_FALSE(board->is_enabled(to_file));
  BusFormat at_node;
  const BusFormat wanted{MEDIA_BUS_FMT_Y10_1X10, 728, 544};
  EXPECT_FALSE(graph.set_format(wanted, at_node));
  EXPECT_EQ(at_node, wanted);
  EXPECT_EQ(statistics->width, 728U);
  EXPECT_EQ(statistics->height, 544U);
  statistics->most_width = 640;
  EXPECT_FALSE(graph.set_format(wanted, at_node));
  EXPECT_EQ(at_node.code, 0U) << "the stream would not start";
  EXPECT_EQ(kernel.open_files(), 3U) << "the branch's file is closed again";
}

TEST_F(MediaGraphTest, TheRateOfARawSensorIsItsBlanking) {
  find("");
  EXPECT_EQ(graph.set_rate(30), 0) << "it cannot be told";
  sensor->pixel_rate = 100'000'000;  // rows of 1456 + 144 pixels
  EXPECT_NEAR(graph.set_rate(0), 1e8 / 1600 / (1088 + 30), 1e-9);
  EXPECT_NEAR(graph.set_rate(30), 30, 0.01);
  EXPECT_EQ(sensor->blank_rows, 995);
  EXPECT_NEAR(graph.set_rate(100), 1e8 / 1600 / (1088 + 30), 1e-9) << "as fast as it goes";
  sensor->pixel_rate = 0;
  sensor->interval = {1, 60};
  EXPECT_NEAR(graph.set_rate(0), 60, 1e-9);
  EXPECT_NEAR(graph.set_rate(25), 25, 1e-9);
}

}  // namespace
}  // namespace epiline

// The media graph of a made-up board: a sensor, a CSI receiver with two outputs, and their video nodes. Against the
// kernel's own graph of vimc: tests/hardware/vimc_test.cc.
#include "drivers/sensors/camera/media_graph.h"

#include <gtest/gtest.h>
#include <sys/sysmacros.h>

#include <string>

#include "tests/drivers/fake_graph.h"

namespace epiline {
namespace {

using namespace epiline::test;

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
    to_node = board->add_link(receiver_out, node, MEDIA_LNK_FL_DYNAMIC);
    to_other = board->add_link(receiver_out, other, kEnabled | MEDIA_LNK_FL_DYNAMIC);
    add_sub_device(11, "v4l-subdev0", sensor);
    add_sub_device(12, "v4l-subdev1", receiver);
  }
  void add_sub_device(int minor, const std::string& name, const std::shared_ptr<FakeSubDevice>& device) {
    test::add_sub_device(kernel, minor, name, device);
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
  EXPECT_TRUE(graph.passes({MEDIA_BUS_FMT_Y10_1X10, 1456, 1088}));
  statistics->most_width = 640;
  EXPECT_FALSE(graph.passes({MEDIA_BUS_FMT_Y10_1X10, 1456, 1088}));
  EXPECT_EQ(statistics->width, 728U) << "asked, not set";
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

// The boards of the guides' three roads, made up: what `epiline init` writes is flown without an edit. Between the two
// only `epiline calibrate --config` sets the files of its calibration.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/sysmacros.h>

#include <filesystem>
#include <memory>
#include <string>

#include "drivers/program/inventory/config_edit.h"
#include "drivers/program/inventory/draft.h"
#include "drivers/program/inventory/parts.h"
#include "drivers/program/inventory/probe.h"
#include "drivers/program/live/devices.h"
#include "drivers/sensors/camera/v4l2_camera.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "tests/drivers/fake_graph.h"
#include "tests/drivers/program/inventory/made_up_computer.h"
#include "tests/drivers/program/must.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using test::must;
using testing::IsEmpty;

class Road : public test::MadeUpComputer {
 protected:
  /// epiline init, then what epiline calibrate sets.
  void init(const Probes& probes) {
    Parts parts = find_parts(root_, kernel_);
    probe(parts, probes);
    const Draft draft = must(draft_configuration(parts));
    EXPECT_THAT(draft.missing, IsEmpty()) << draft.toml;
    const fs::path file = root_ / "epiline.toml";
    ASSERT_TRUE(write_draft(draft, file, false));
    const CameraConfig c = must(read_live_settings(file, {}, CalibrationNeed::kIfGiven)).config.devices.camera;
    const fs::path lens = write("camera.yaml",
                                "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
                                "camera_model: pinhole\nintrinsics: [400, 400, 320, 200]\n"
                                "distortion_model: none\ndistortion_coefficients: []\nresolution: [" +
                                    std::to_string(c.width) + ", " + std::to_string(c.height) + "]\n");
    ASSERT_TRUE(edit_config(file, {{"camera", "calibration", lens.string()}}));
  }
  /// epiline run: it takes the configuration, and the camera gives an image of the calibrated size.
  LiveSettings take() {
    const LiveSettings settings = must(read_live_settings(root_ / "epiline.toml"));
    EXPECT_FALSE(must(make_devices(settings)).outputs.empty());
    V4l2Camera camera(must(v4l2_settings_of(settings.config.devices.camera)), kernel_);
    must(camera.open());
    Frame frame;
    ReadOutcome outcome = ReadOutcome::kTimeout;
    for (int i = 0; i < 100 && outcome != ReadOutcome::kSample; ++i)
      outcome = camera.read(frame, Span::from_milliseconds(100));
    EXPECT_EQ(outcome, ReadOutcome::kSample);
    EXPECT_EQ(frame.width, settings.camera.width);
    EXPECT_EQ(frame.height, settings.camera.height);
    if (outcome == ReadOutcome::kSample) camera.give_back(frame);
    camera.close();
    return settings;
  }
  static Probes nothing() {
    return {[](const std::string&) { return SpiChip::kUnknown; },
            [](const std::string&, int, bool&) { return std::optional<HeardController>(); },
            [](const Parts&, const ChipPart&) { return std::string(); }};
  }
};

/// A receiver whose nodes take any format in any size, and before it an OV9281.
TEST_F(Road, RaspberryPi5) {
  const auto graph = std::make_shared<test::FakeGraph>();
  kernel_.devices["/dev/media0"] = graph;
  const auto sensor = std::make_shared<test::FakeSubDevice>(), receiver = std::make_shared<test::FakeSubDevice>();
  sensor->codes = {MEDIA_BUS_FMT_Y10_1X10, MEDIA_BUS_FMT_Y8_1X8};
  sensor->sizes = {{1280, 800}, {1280, 720}, {640, 400}};
  sensor->pixel_rate = 160'000'000;
  const std::uint32_t of_sensor = graph->add_entity("ov9281 10-0060", MEDIA_ENT_F_CAM_SENSOR, 11),
                      of_receiver = graph->add_entity("csi2", MEDIA_ENT_F_VID_IF_BRIDGE, 12);
  graph->add_link(graph->add_pad(of_sensor, 0, true), graph->add_pad(of_receiver, 0, false), test::kEnabled);
  for (unsigned i = 0; i < 2; ++i) {
    const std::string number = std::to_string(i);
    const std::uint32_t node = graph->add_entity(("rp1-cfe-csi2_ch" + number).c_str(), MEDIA_ENT_F_IO_V4L, 1 + i);
    graph->add_link(graph->add_pad(of_receiver, 1 + i, true), graph->add_pad(node, 0, false), 0);
    const auto camera = add_camera("video" + number);
    camera->device_number = makedev(test::kMajor, 1 + i);
    camera->card = camera->driver = "rp1-cfe";
    camera->bus = "platform:1f00110000.csi";
    camera->takes_any_size = true;
    camera->has_rate = false;
    camera->formats = {{V4L2_PIX_FMT_YUYV, {{640, 480, {}}}}, {V4L2_PIX_FMT_GREY, {{640, 480, {}}}}};
  }
  test::add_sub_device(kernel_, 11, "v4l-subdev0", sensor);
  test::add_sub_device(kernel_, 12, "v4l-subdev1", receiver);
  for (const char* device : {"dev/spidev0.0", "dev/spidev0.1", "dev/ttyAMA0", "dev/ttyAMA10"}) write(device);
  init({[](const std::string& path) { return path == "/dev/spidev0.0" ? SpiChip::kIcm42688p : SpiChip::kUnknown; },
        [](const std::string& port, int baud, bool&) {
          return port == "/dev/ttyAMA0" && baud == 921'600 ? std::optional(HeardController{1, 12}) : std::nullopt;
        },
        [](const Parts&, const ChipPart&) { return std::string("GPIO25"); }});
  EXPECT_EQ(sensor->width, 1456U) << "init changes nothing";
  const LiveSettings taken = take();
  const DevicesConfig& d = taken.config.devices;
  EXPECT_EQ(d.camera.device, "rp1-cfe-csi2_ch0");
  EXPECT_EQ(d.camera.format, "GREY");
  EXPECT_EQ(d.camera.width, 640);
  EXPECT_EQ(d.camera.height, 400);
  EXPECT_EQ(d.camera.rate_hz, 30);
  EXPECT_EQ(sensor->width, 640U) << "run sets it up";
  EXPECT_EQ(d.imu.driver, static_cast<int>(ImuDriver::kIcm42688p));
  EXPECT_EQ(d.imu.ready_line, "GPIO25");
  EXPECT_EQ(d.mavlink.serial, "/dev/ttyAMA0");
}

TEST_F(Road, UsbCameraAndTheControllersImu) {
  add_camera("video0")->formats = {{V4L2_PIX_FMT_YUYV, {{640, 480, {30}}, {1280, 720, {10}}}},
                                   {V4L2_PIX_FMT_MJPEG, {{1280, 720, {30}}}}};
  add_flight_controller_on_usb();
  init(nothing());
  const LiveSettings taken = take();
  EXPECT_EQ(taken.config.devices.imu.driver, static_cast<int>(ImuDriver::kMavlink));
  EXPECT_EQ(taken.config.devices.mavlink.serial, "/dev/ttyACM0");
  EXPECT_EQ(taken.config.devices.camera.format, "YUYV");
}

TEST_F(Road, RoverOnCan) {
  add_camera("video0")->formats = {{V4L2_PIX_FMT_GREY, {{1280, 800, {30, 60}}, {640, 400, {30, 60, 120}}}}};
  const std::string imu = "sys/bus/iio/devices/iio:device0/";
  write(imu + "name", "adis16475-2");
  write(imu + "in_anglvel_x_raw", "1");
  write(imu + "in_accel_x_raw", "1");
  write(imu + "scan_elements/in_anglvel_x_en", "0");
  add_can();
  init(nothing());
  const LiveSettings taken = take();
  EXPECT_EQ(taken.config.devices.can.interface, "can0");
  EXPECT_TRUE(taken.config.devices.can.fd);
  EXPECT_EQ(taken.config.devices.imu.device, "adis16475-2");
  EXPECT_EQ(taken.config.devices.camera.width, 640);
}

}  // namespace
}  // namespace epiline

// Which of several nodes is opened, and what of the lens is held.
#include "drivers/sensors/camera/v4l2_device.h"

#include <gtest/gtest.h>
#include <sys/sysmacros.h>

#include "tests/drivers/fake_camera.h"
#include "tests/drivers/fake_graph.h"
#include "tests/drivers/sensors/camera/camera_rig.h"

namespace epiline {
namespace {

using namespace epiline::test;

/// Two receivers of one kind, as on a Raspberry Pi 5: each has a graph of its own, and their nodes have the same names.
class TwoReceivers : public testing::Test {
 protected:
  void add(int number, const char* sensor_name) {
    const auto graph = std::make_shared<FakeGraph>();
    const std::string n = std::to_string(number);
    const auto minor = static_cast<unsigned>(20 + 10 * number);
    const std::uint32_t receiver = graph->add_entity("csi2", MEDIA_ENT_F_VID_IF_BRIDGE, minor + 1),
                        node = graph->add_entity("rp1-cfe-csi2_ch0", MEDIA_ENT_F_IO_V4L, minor);
    const std::uint32_t in = graph->add_pad(receiver, 0, false), out = graph->add_pad(receiver, 1, true);
    graph->add_link(out, graph->add_pad(node, 0, false), kEnabled);
    add_sub_device(kernel, static_cast<int>(minor + 1), "v4l-subdev1" + n, std::make_shared<FakeSubDevice>());
    if (sensor_name != nullptr) {
      const std::uint32_t sensor = graph->add_entity(sensor_name, MEDIA_ENT_F_CAM_SENSOR, minor + 2);
      graph->add_link(graph->add_pad(sensor, 0, true), in, kEnabled);
      add_sub_device(kernel, static_cast<int>(minor + 2), "v4l-subdev2" + n, std::make_shared<FakeSubDevice>());
    }
    const auto camera = std::make_shared<FakeCamera>(kernel);
    camera->card = camera->driver = "rp1-cfe";
    camera->bus = "platform:1f0012800" + n + ".csi";
    camera->device_number = makedev(kMajor, minor);
    kernel.devices["/dev/video" + n] = camera;
    kernel.devices["/dev/media" + n] = graph;
  }
  std::string opened(const char* name, const char* sensor) {
    DeviceTrouble trouble = device.open(name, sensor);
    if (!trouble) trouble = device.set_graph(sensor);
    return trouble ? error_of(trouble, device.path()).text() : device.path() + std::string(" ") + device.sensor_name();
  }

  FakeKernel kernel;
  V4l2Device device{kernel};
};

TEST_F(TwoReceivers, TheNodeThatTheSensorLeadsToIsTaken) {
  add(0, "imx296 4-001a");
  add(1, "ov9281 6-0060");
  for (const char* name : {"rp1-cfe-csi2_ch0", "rp1-cfe"}) {
    EXPECT_EQ(opened(name, "imx296"), "/dev/video0 imx296 4-001a");
    EXPECT_EQ(opened(name, "ov9281"), "/dev/video1 ov9281 6-0060");
    EXPECT_EQ(opened(name, ""), "/dev/video0 imx296 4-001a");
    const std::string error = opened(name, "imx219");
    EXPECT_NE(error.find("no sensor \"imx219\""), std::string::npos) << error;
  }
  const std::size_t files = kernel.open_files();
  device.close();
  EXPECT_LT(kernel.open_files(), files);
  EXPECT_EQ(kernel.open_files(), 0U);
}

TEST_F(TwoReceivers, APortWithoutASensorIsPassedOver) {
  add(0, nullptr);
  add(1, "ov9281 6-0060");
  EXPECT_EQ(opened("rp1-cfe-csi2_ch0", ""), "/dev/video1 ov9281 6-0060");
}

TEST_F(TwoReceivers, TheLostOneIsFoundAgain) {
  add(0, "imx296 4-001a");
  add(1, "ov9281 6-0060");
  ASSERT_EQ(opened("rp1-cfe", "ov9281"), "/dev/video1 ov9281 6-0060");
  const DeviceIdentity lost = device.identity();
  bool is_other = false;
  EXPECT_FALSE(device.open_again("rp1-cfe", "ov9281", lost, is_other));
  EXPECT_STREQ(device.path(), "/dev/video1");
  EXPECT_FALSE(is_other);
}

TEST(V4l2Focus, IsHeldUnlessAskedForOrNotThere) {
  constexpr const char* kAutofocus = "Focus, Automatic Continuous";
  struct Case {
    bool has_it, is_asked_for;
    Focus expected;
  };
  for (const Case& c :
       {Case{true, false, Focus::kHeld}, {true, true, Focus::kAutomatic}, {false, false, Focus::kUnknown}}) {
    CameraRig rig;
    if (c.has_it) rig.device->controls.push_back({V4L2_CID_FOCUS_AUTO, kAutofocus, c.is_asked_for ? 0 : 1, 1});
    if (c.is_asked_for) rig.settings.controls = {{"focus_automatic_continuous", 1}};
    rig.open();
    EXPECT_EQ(rig.camera->focus(), c.expected);
    if (!c.has_it) continue;
    EXPECT_EQ(rig.device->control(kAutofocus).value, c.is_asked_for ? 1 : 0);
  }
}

}  // namespace
}  // namespace epiline

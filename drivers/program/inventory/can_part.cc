#include <fmt/format.h>
#include <linux/can/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>

#include <array>
#include <charconv>
#include <cstring>

#include "drivers/program/inventory/find.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;

constexpr std::array kStates{"error-active", "error-warning", "error-passive", "bus-off", "stopped", "sleeping"};

int number_in(const std::string& text) {
  int number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

/// Calls use(type, payload, bytes) for each attribute.
template <class Use>
void each_attribute(const void* attributes, std::size_t bytes, Use use) {
  const auto* attribute = static_cast<const rtattr*>(attributes);
  for (int left = static_cast<int>(bytes); RTA_OK(attribute, left); attribute = RTA_NEXT(attribute, left))
    use(attribute->rta_type & NLA_TYPE_MASK, RTA_DATA(attribute), static_cast<std::size_t>(RTA_PAYLOAD(attribute)));
}

template <class T>
T copy_of(const void* payload, std::size_t bytes) {
  T value{};
  if (bytes >= sizeof value) std::memcpy(&value, payload, sizeof value);
  return value;
}

void read_controller(const void* attributes, std::size_t bytes, CanPart& part) {
  each_attribute(attributes, bytes, [&](int type, const void* payload, std::size_t size) {
    if (type == IFLA_CAN_BITTIMING) part.bitrate = copy_of<can_bittiming>(payload, size).bitrate;
    if (type == IFLA_CAN_DATA_BITTIMING) part.data_bitrate = copy_of<can_bittiming>(payload, size).bitrate;
    if (type != IFLA_CAN_STATE) return;
    const auto state = copy_of<std::uint32_t>(payload, size);
    if (state < kStates.size()) part.state = kStates[state];
  });
}

/// The kernel's answer to the request for one link.
void read_link(const std::byte* bytes, std::size_t count, CanPart& part) {
  const auto header = copy_of<nlmsghdr>(bytes, count);
  constexpr std::size_t kBefore = NLMSG_LENGTH(sizeof(ifinfomsg));
  if (header.nlmsg_type != RTM_NEWLINK || header.nlmsg_len > count || header.nlmsg_len < kBefore) return;
  part.is_up = (copy_of<ifinfomsg>(bytes + NLMSG_HDRLEN, sizeof(ifinfomsg)).ifi_flags & IFF_UP) != 0;
  each_attribute(bytes + NLMSG_ALIGN(kBefore), header.nlmsg_len - kBefore,
                 [&](int type, const void* payload, std::size_t size) {
                   if (type != IFLA_LINKINFO) return;
                   each_attribute(payload, size, [&](int inner, const void* data, std::size_t data_size) {
                     if (inner == IFLA_INFO_DATA) read_controller(data, data_size, part);
                   });
                 });
}

/// By rtnetlink(7): sysfs has neither bit rates nor the controller's state.
void ask_kernel(int index, SystemCalls& system, CanPart& part) {
  const int fd = system.socket(AF_NETLINK, SOCK_RAW, NETLINK_ROUTE);
  if (fd < 0) return;
  struct {
    nlmsghdr header{};
    ifinfomsg link{};
  } request;
  request.header.nlmsg_len = sizeof request;
  request.header.nlmsg_type = RTM_GETLINK;
  request.header.nlmsg_flags = NLM_F_REQUEST;
  request.link.ifi_family = AF_UNSPEC;
  request.link.ifi_index = index;
  alignas(nlmsghdr) std::array<std::byte, 16384> answer{};
  if (system.write(fd, &request, sizeof request) == sizeof request) {
    const ssize_t count = system.read(fd, answer.data(), answer.size());  // the kernel has answered within write()
    if (count > 0) read_link(answer.data(), static_cast<std::size_t>(count), part);
  }
  system.close(fd);
}

std::string trouble_of(const CanPart& part, bool is_virtual) {
  if (part.state == "bus-off") return "bus-off; check bit rate, termination and wiring (docs/can.md)";
  if (part.is_up) return "";
  return fmt::format("it is down; sudo ip link set {} up{}", part.path,
                     is_virtual || part.bitrate > 0 ? "" : " type can bitrate BITRATE");
}

}  // namespace

CanPart find_can(const fs::path& root, const ListedDevice& listed, SystemCalls& system) {
  const fs::path folder = root / "sys/class/net" / listed.path;
  CanPart part;
  part.path = listed.path;
  part.state = listed.name;
  part.is_up = listed.name == "up";
  part.has_fd = number_in(first_line(folder / "mtu")) >= 72;  // CANFD_MTU
  ask_kernel(number_in(first_line(folder / "ifindex")), system, part);
  std::error_code none;
  part.trouble = trouble_of(part, !fs::exists(folder / "device", none));
  part.settings = {{"can.interface", part.path}, {"wheel.interface", part.path}};
  return part;
}

}  // namespace epiline

#include "drivers/sensors/camera/v4l2_controls.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>

#include "drivers/sensors/camera/v4l2_lists.h"
#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

bool is_settable(std::uint32_t type) noexcept {
  return type == V4L2_CTRL_TYPE_INTEGER || type == V4L2_CTRL_TYPE_BOOLEAN || type == V4L2_CTRL_TYPE_MENU ||
         type == V4L2_CTRL_TYPE_INTEGER_MENU || type == V4L2_CTRL_TYPE_BITMASK || type == V4L2_CTRL_TYPE_INTEGER64 ||
         type == V4L2_CTRL_TYPE_BUTTON;
}

}  // namespace

int call_device(SystemCalls& system, int fd, unsigned long request, void* argument) noexcept {
  int result = 0;
  do result = system.ioctl(fd, request, argument);
  while (result < 0 && errno == EINTR);
  return result < 0 ? errno : 0;
}

void write_control_name(const char* shown, std::span<char> name) noexcept {
  std::size_t used = 0;
  bool gap = false;
  for (; *shown != '\0' && used + 2 < name.size(); ++shown) {
    const auto c = static_cast<unsigned char>(*shown);
    if (std::isalnum(c) == 0) {
      gap = used > 0;
      continue;
    }
    if (gap) name[used++] = '_';
    gap = false;
    name[used++] = static_cast<char>(std::tolower(c));
  }
  name[used] = '\0';
}

template <class IsWanted>
bool V4l2Controls::find_first(IsWanted is_wanted, ControlFacts& facts) const noexcept {
  bool is_found = false;
  each_control(*this, [&](const v4l2_query_ext_ctrl& query, std::size_t file) {
    is_found = is_wanted(query);
    if (!is_found) return true;
    facts.id = query.id;
    facts.file = file;
    facts.type = query.type;
    facts.is_readable = (query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) == 0;
    facts.least = query.minimum;
    facts.most = query.maximum;
    return false;
  });
  return is_found;
}

bool V4l2Controls::find(std::uint32_t id, ControlFacts& facts) const noexcept {
  return find_first([&](const v4l2_query_ext_ctrl& query) { return query.id == id; }, facts);
}

DeviceTrouble V4l2Controls::find(const char* name, ControlFacts& facts) const noexcept {
  const auto is_called = [&](const v4l2_query_ext_ctrl& query) {
    char shown[2 * sizeof(query.name)];
    write_control_name(query.name, shown);
    return std::strcmp(shown, name) == 0;
  };
  if (!find_first(is_called, facts))
    return unexpected("VIDIOC_QUERY_EXT_CTRL", "one that v4l2-ctl --list-ctrls shows",
                      "the camera has no control '%.60s'", name);
  if (is_settable(facts.type)) return {};
  return unexpected("VIDIOC_QUERY_EXT_CTRL", "a control with a number", "the control '%.60s' is not a number", name);
}

DeviceTrouble V4l2Controls::read(const char* name, const ControlFacts& facts, std::int64_t& value) const noexcept {
  v4l2_ext_control control{};
  v4l2_ext_controls controls{};
  control.id = facts.id;
  controls.which = V4L2_CTRL_WHICH_CUR_VAL;
  controls.count = 1;
  controls.controls = &control;
  DeviceTrouble trouble = refused("VIDIOC_G_EXT_CTRLS", call(control_file(facts.file), VIDIOC_G_EXT_CTRLS, &controls));
  std::snprintf(trouble.found, sizeof(trouble.found), "%s", name);
  value = facts.type == V4L2_CTRL_TYPE_INTEGER64 ? control.value64 : control.value;
  return trouble;
}

DeviceTrouble V4l2Controls::write(std::span<const ControlValue> values) const noexcept {
  std::array<v4l2_ext_control, kTogether> control{};
  v4l2_ext_controls controls{};
  controls.which = V4L2_CTRL_WHICH_CUR_VAL;
  controls.controls = control.data();
  for (const ControlValue& wanted : values) {
    v4l2_ext_control& one = control[controls.count++];
    one.id = wanted.facts->id;
    if (wanted.facts->type == V4L2_CTRL_TYPE_INTEGER64)
      one.value64 = wanted.value;
    else
      one.value = static_cast<std::int32_t>(wanted.value);
  }
  DeviceTrouble trouble =
      refused("VIDIOC_S_EXT_CTRLS", call(control_file(values[0].facts->file), VIDIOC_S_EXT_CTRLS, &controls));
  const ControlValue& told = values[std::min<std::size_t>(controls.error_idx, values.size() - 1)];
  std::snprintf(trouble.found, sizeof(trouble.found), "%.60s = %lld", told.name, static_cast<long long>(told.value));
  return trouble;
}

DeviceTrouble V4l2Controls::write(const char* name, std::int64_t value) const noexcept {
  ControlFacts facts;
  if (const DeviceTrouble trouble = find(name, facts)) return trouble;
  const ControlValue one{&facts, name, value};
  return write({&one, 1});
}

DeviceTrouble V4l2Controls::change(std::span<ControlValue> values) const noexcept {
  // at once where one device has them all
  const auto is_elsewhere = [&](const ControlValue& v) { return v.facts->file != values[0].facts->file; };
  const std::size_t together = std::any_of(values.begin(), values.end(), is_elsewhere) ? 1 : values.size();
  for (std::size_t i = 0; i < values.size(); i += together)
    if (const DeviceTrouble trouble = write(values.subspan(i, together))) return trouble;
  for (ControlValue& v : values) {
    if (!v.facts->is_readable) continue;
    if (const DeviceTrouble trouble = read(v.name, *v.facts, v.value)) return trouble;
  }
  return {};
}

}  // namespace epiline

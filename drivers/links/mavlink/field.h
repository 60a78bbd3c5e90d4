#pragma once
// One member of a MAVLink message, as message.h and answer_messages.h list them.
namespace epiline::mavlink {

/// One member of a message. Extensions came later: older programs do not send them.
template <class Message, class T>
struct Field {
  const char* name;
  T Message::*member;
  bool extension = false;
};
template <class Message, class T>
constexpr Field<Message, T> field(const char* name, T Message::*member) {
  return {name, member, false};
}
template <class Message, class T>
constexpr Field<Message, T> extension(const char* name, T Message::*member) {
  return {name, member, true};
}

}  // namespace epiline::mavlink

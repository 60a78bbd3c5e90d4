#pragma once
// The members of MAVLink messages, as message.h lists them, and what follows from them: the length of a message and the
// seed of its checksum.
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace epiline::mavlink {

/// Members of a message in the order they travel in. Each message has `Fields`, and may have `Extensions`, which came
/// later: older programs do not send them.
template <auto... kMembers>
struct Members {};

/// A member, as visitors get it.
template <class Message, class T>
struct Field {
  T Message::*member;
  std::string_view name;
  bool extension;
};
template <class Message, class T>
Field(T Message::*, std::string_view, bool) -> Field<Message, T>;

/// As the source writes it. Compilers end this function's name with "kMember = &Message::name]" or "...::name; ...]".
template <auto kMember>
constexpr std::string_view name_of() {
  constexpr std::string_view kText = __PRETTY_FUNCTION__;
  constexpr std::size_t kEnd = kText.find_first_of(";]", kText.find("kMember = ")), kBegin = kText.rfind(':', kEnd) + 1;
  return kText.substr(kBegin, kEnd - kBegin);
}

/// visit(field) for each, in the order they travel in.
template <class Message, class Visit>
constexpr void for_each_field(Visit&& visit) {
  const auto visit_all = [&]<auto... kMembers>(Members<kMembers...>, bool extensions) {
    (visit(Field{kMembers, name_of<kMembers>(), extensions}), ...);
  };
  visit_all(typename Message::Fields{}, false);
  if constexpr (requires { typename Message::Extensions; }) visit_all(typename Message::Extensions{}, true);
}

/// The checksum of frames: CRC-16/MCRF4XX, begins with 0xffff.
constexpr std::uint16_t crc_add(std::uint16_t crc, std::uint8_t byte) {
  const auto low = static_cast<std::uint8_t>(byte ^ (crc & 0xff));
  const auto mixed = static_cast<std::uint8_t>(low ^ (low << 4));
  return static_cast<std::uint16_t>((crc >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4));
}
constexpr std::uint16_t crc_add(std::uint16_t crc, std::string_view text) {
  for (const char c : text) crc = crc_add(crc, static_cast<std::uint8_t>(c));
  return crc_add(crc, std::uint8_t{' '});
}

template <class T>
struct Element {
  using Type = T;
  static constexpr std::uint8_t kCount = 0;  ///< no array
};
template <class T, std::size_t N>
struct Element<std::array<T, N>> {
  using Type = T;
  static constexpr std::uint8_t kCount = N;
};

/// As the definitions of messages write it.
template <class T>
constexpr std::string_view type_name() {
  if constexpr (std::same_as<T, char>) return "char";
  if constexpr (std::same_as<T, float>) return "float";
  if constexpr (std::same_as<T, std::uint8_t>) return "uint8_t";
  if constexpr (std::same_as<T, std::int8_t>) return "int8_t";
  if constexpr (std::same_as<T, std::uint16_t>) return "uint16_t";
  if constexpr (std::same_as<T, std::int16_t>) return "int16_t";
  if constexpr (std::same_as<T, std::uint32_t>) return "uint32_t";
  if constexpr (std::same_as<T, std::int32_t>) return "int32_t";
  if constexpr (std::same_as<T, std::uint64_t>) return "uint64_t";
  if constexpr (std::same_as<T, std::int64_t>) return "int64_t";
}

/// Bytes of the payload, with extensions or without.
template <class Message>
constexpr std::size_t length_of(bool extensions = true) {
  std::size_t bytes = 0;
  for_each_field<Message>([&]<class M, class T>(const Field<M, T>& f) {
    if (extensions || !f.extension) bytes += sizeof(T);
  });
  return bytes;
}

/// What is needed to take a message apart without knowing its members.
struct MessageInfo {
  std::uint32_t id;
  std::uint8_t length, base_length, crc_extra;
};

/// A message as it is published: its name, its length with extensions and without, and the seed of its checksum, which
/// is made of all names, types and their order. Compiles if and only if the members are those of that message, the
/// larger ones first.
template <class Message>
consteval MessageInfo published(std::string_view name, std::uint8_t length, std::uint8_t base_length,
                                std::uint8_t seed) {
  std::uint16_t crc = crc_add(0xffff, name);
  std::size_t before = 8;
  bool is_in_order = true;
  for_each_field<Message>([&]<class M, class T>(const Field<M, T>& f) {
    if (f.extension) return;
    using E = Element<T>;
    crc = crc_add(crc_add(crc, type_name<typename E::Type>()), f.name);
    if (E::kCount > 0) crc = crc_add(crc, E::kCount);
    is_in_order = is_in_order && sizeof(typename E::Type) <= before;
    before = sizeof(typename E::Type);
  });
  const bool is_right = is_in_order && length_of<Message>() == length && length_of<Message>(false) == base_length &&
                        ((crc & 0xff) ^ (crc >> 8)) == seed;
  if (!is_right) throw "these are not the members of that message";
  return {Message::kId, length, base_length, seed};
}

}  // namespace epiline::mavlink

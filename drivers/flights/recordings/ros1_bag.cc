// ROS 1 bags, format 2.0: records of a header (fields `name=value`) and data. A bag that is being recorded ends in a
// chunk whose header says nothing yet; its records then lie open.
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/flights/recordings/bag_reader.h"
#include "drivers/flights/recordings/byte_reader.h"

namespace epiline {

namespace {

constexpr std::uint64_t kRos1Begin = 13;  // behind the line that names the format
enum Ros1Op : std::uint8_t { kRos1Message = 2, kRos1Chunk = 5, kRos1Connection = 7 };

struct Ros1Fields {
  std::map<std::string_view, std::span<const std::uint8_t>> values;
  bool good = true;

  explicit Ros1Fields(std::span<const std::uint8_t> bytes) {
    for (ByteReader in(bytes); good && in.left() > 0;) {
      const std::string_view field = in.text();
      const std::size_t equals = field.find('=');
      good = in.good() && equals != std::string_view::npos;
      if (!good) return;
      const auto* value = reinterpret_cast<const std::uint8_t*>(field.data()) + equals + 1;
      values[field.substr(0, equals)] = {value, field.size() - equals - 1};
    }
  }
  template <class T>
  std::optional<T> number(std::string_view name) const {
    const auto found = values.find(name);
    if (found == values.end() || found->second.size() != sizeof(T)) return std::nullopt;
    return ByteReader(found->second).number<T>();
  }
  std::string text(std::string_view name) const {
    const auto found = values.find(name);
    if (found == values.end()) return {};
    return {reinterpret_cast<const char*>(found->second.data()), found->second.size()};
  }
};

Packing ros1_packing(const std::string& name) {
  if (name == "none") return Packing::kNone;
  if (name == "bz2") return Packing::kBz2;
  return name == "lz4" ? Packing::kLz4 : Packing::kUnknown;
}

class Ros1Bag final : public RecordFile {
 public:
  using RecordFile::RecordFile;

  Status scan(const See& see) override {
    Bytes head, data;
    for (std::uint64_t at = kRos1Begin; at < file().size();) {
      const std::uint64_t begin = at;
      std::uint64_t head_size = 0, data_size = 0;
      if (!read_size(at, head_size) || !file().read(at, head_size, head)) return ends_early(begin);
      at += head_size;
      if (!read_size(at, data_size) || !file().holds(at, data_size)) return ends_early(begin);
      const Ros1Fields fields(head);
      const auto op = fields.number<std::uint8_t>("op");
      if (!fields.good || !op) return damaged(begin, "no record");
      if (*op == kRos1Chunk) {
        if (const Status s = scan_chunk(fields, at, data_size, see); !s) return s;
      } else if (*op == kRos1Message || *op == kRos1Connection) {
        if (!file().read(at, data_size, data)) return ends_early(begin);
        if (!take(*op, fields, data, {0, 0, at, data_size}, see)) return damaged(begin, "an incomplete record");
      }
      at += data_size;
    }
    return Done{};
  }

 private:
  bool read_size(std::uint64_t& at, std::uint64_t& size) {
    if (!file().read(at, sizeof(std::uint32_t), size_)) return false;
    size = ByteReader(size_).number<std::uint32_t>();
    at += sizeof(std::uint32_t);
    return true;
  }

  Status scan_chunk(const Ros1Fields& fields, std::uint64_t at, std::uint64_t size, const See& see) {
    if (size == 0) return Done{};
    const std::string name = fields.text("compression");
    const Packing packing = ros1_packing(name);
    if (packing == Packing::kUnknown) return damaged(at, "a chunk with the compression \"" + name + "\"");
    const auto bytes = open_chunk({at, size, fields.number<std::uint32_t>("size").value_or(0), packing});
    if (!bytes) return bytes.error();
    const std::uint32_t chunk = chunks();
    for (ByteReader in(*bytes); in.left() > 0;) {
      const Ros1Fields inner(in.block<std::uint32_t>());
      const auto data = in.block<std::uint32_t>();
      const auto op = inner.number<std::uint8_t>("op");
      const BagPlace place{0, packing == Packing::kNone ? 0 : chunk,
                           in.at() - data.size() + (packing == Packing::kNone ? at : 0), data.size()};
      const bool is_known = op && (*op == kRos1Message || *op == kRos1Connection);
      if (!in.good() || !inner.good || !op || (is_known && !take(*op, inner, data, place, see)))
        return damaged(at + (packing == Packing::kNone ? in.at() : 0), "an incomplete record in a chunk");
    }
    return Done{};
  }

  /// A message or a connection; false if it lacks something.
  bool take(std::uint8_t op, const Ros1Fields& head, std::span<const std::uint8_t> data, const BagPlace& place,
            const See& see) {
    const auto connection = head.number<std::uint32_t>("conn");
    if (!connection) return false;
    if (op == kRos1Connection) {
      const Ros1Fields about(data);
      if (!about.good) return false;
      topic_of_[*connection] = add_topic({head.text("topic"), about.text("type"), "ros1"});
      return true;
    }
    const auto time = head.number<std::uint64_t>("time");
    const auto topic = topic_of_.find(*connection);
    if (!time || topic == topic_of_.end()) return false;
    const auto seconds = static_cast<std::int64_t>(*time & 0xffffffff), ns = static_cast<std::int64_t>(*time >> 32);
    see({topic->second, seconds * 1'000'000'000 + ns, data, place});
    return true;
  }

  std::map<std::uint32_t, std::size_t> topic_of_;  ///< by connection
  Bytes size_;
};

}  // namespace

std::unique_ptr<BagReader> ros1_bag_reader(const std::filesystem::path& path) {
  return std::make_unique<Ros1Bag>(path);
}

}  // namespace epiline

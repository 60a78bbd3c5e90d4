#pragma once
// Bags of every format, written as the pages of the formats say, for tests of what reads them.
#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zstd.h>

#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "tests/drivers/program/program.h"

namespace epiline {

/// Bytes with little-endian numbers.
struct Packer {
  std::string bytes;
  template <class T>
  Packer& put(T value) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    bytes.append(raw, sizeof(T));
    return *this;
  }
  template <class Size>
  Packer& block(const std::string& text) {
    put(static_cast<Size>(text.size()));
    bytes += text;
    return *this;
  }
};

/// Numbers as they are, texts behind their size in 32 bits.
template <class... T>
std::string packed(const T&... values) {
  Packer p;
  const auto add = [&p](const auto& value) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(value)>>)
      p.put(value);
    else
      p.block<std::uint32_t>(value);
  };
  (add(values), ...);
  return p.bytes;
}

/// A message, as ROS 1 or ROS 2 (CDR) packs it.
struct RawMessage {
  std::string type;  ///< as ROS 1 writes it
  bool is_cdr = false;
  Packer p = {};

  template <class T>
  RawMessage& put(T value) {
    if (is_cdr) begin().bytes.resize((p.bytes.size() - 4 + sizeof(T) - 1) / sizeof(T) * sizeof(T) + 4);
    p.put(value);
    return *this;
  }
  RawMessage& u8(std::uint8_t v) { return put(v); }
  RawMessage& u32(std::size_t v) { return put(static_cast<std::uint32_t>(v)); }
  RawMessage& f64(double v) { return put(v); }
  RawMessage& text(const std::string& v) { return is_cdr ? block(v.c_str(), v.size() + 1) : block(v.data(), v.size()); }
  RawMessage& block(const void* data, std::size_t size) {
    u32(size);
    p.bytes.append(static_cast<const char*>(data), size);
    return *this;
  }
  RawMessage& header(std::int64_t ns) {
    if (!is_cdr) u32(7);
    return u32(static_cast<std::size_t>(ns / 1'000'000'000))
        .u32(static_cast<std::size_t>(ns % 1'000'000'000))
        .text("frame");
  }
  const std::string& bytes() { return begin().bytes; }

 private:
  Packer& begin() {
    if (is_cdr && p.bytes.empty()) p.bytes = std::string("\0\1\0\0", 4);
    return p;
  }
};

inline std::string zstd_of(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1));
  return packed;
}
inline std::string lz4_of(const std::string& bytes) {
  std::string packed(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
  packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
  return packed;
}
inline std::string bz2_of(const std::string& bytes) {
  std::string packed(bytes.size() + bytes.size() / 50 + 1000, '\0');
  auto size = static_cast<unsigned>(packed.size());
  BZ2_bzBuffToBuffCompress(packed.data(), &size, const_cast<char*>(bytes.data()), static_cast<unsigned>(bytes.size()),
                           1, 0, 0);
  packed.resize(size);
  return packed;
}
inline std::string packed_as(const std::string& packing, const std::string& bytes) {
  return packing == "bz2"    ? bz2_of(bytes)
         : packing == "lz4"  ? lz4_of(bytes)
         : packing == "zstd" ? zstd_of(bytes)
                             : bytes;
}

class BagWriter {
 public:
  BagWriter() = default;
  virtual ~BagWriter() = default;
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;
  virtual bool is_cdr() const = 0;
  virtual void write(const std::string& topic, std::int64_t ns, RawMessage message) = 0;
  RawMessage message(const std::string& type) const { return {type, is_cdr()}; }

 protected:
  static constexpr std::size_t kChunk = 100'000;
};

/// ROS 1, format 2.0, without an index. `packing`: none, bz2, lz4.
class Ros1Writer final : public BagWriter {
 public:
  explicit Ros1Writer(fs::path path, std::string packing = "none")
      : path_(std::move(path)), packing_(std::move(packing)) {
    file_ = "#ROSBAG V2.0\n";
    record(file_, {field("op", "\3"), field("index_pos", std::string(8, '\1'))}, std::string(4000, ' '));
  }
  ~Ros1Writer() override {
    flush();
    epiline::write(path_, file_);
  }
  bool is_cdr() const override { return false; }
  void write(const std::string& topic, std::int64_t ns, RawMessage message) override {
    const auto [at, is_new] = connections_.try_emplace(topic, static_cast<std::uint32_t>(connections_.size()));
    const std::string number = packed(at->second);
    if (is_new) {
      record(chunk_, {field("op", "\7"), field("conn", number), field("topic", topic)},
             field("topic", topic) + field("type", message.type) + field("md5sum", "*"));
    }
    const std::string time =
        packed(static_cast<std::uint32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000));
    record(chunk_, {field("op", "\2"), field("conn", number), field("time", time)}, message.bytes());
    if (chunk_.size() > kChunk) flush();
  }

 private:
  static std::string field(const std::string& name, const std::string& value) { return packed(name + "=" + value); }
  static void record(std::string& to, const std::vector<std::string>& fields, const std::string& data) {
    std::string head;
    for (const std::string& f : fields) head += f;
    to += packed(head, data);
  }
  void flush() {
    if (chunk_.empty()) return;
    const std::string size = packed(static_cast<std::uint32_t>(chunk_.size()));
    record(file_, {field("op", "\5"), field("compression", packing_), field("size", size)},
           packed_as(packing_, chunk_));
    record(file_, {field("op", "\4")}, "an index, which is not needed");
    chunk_.clear();
  }
  fs::path path_;
  std::string packing_, file_, chunk_;
  std::map<std::string, std::uint32_t> connections_;
};

/// MCAP. `packing`: of chunks "", lz4, zstd; "message": zstd for each message; "open": no chunks.
class McapWriter final : public BagWriter {
 public:
  McapWriter(fs::path path, std::string packing, bool is_cdr = true)
      : path_(std::move(path)), packing_(std::move(packing)), is_cdr_(is_cdr) {
    file_ = kMagic;
    record(file_, 1, packed(is_cdr ? "ros2" : "ros1", "test"));
  }
  ~McapWriter() override {
    flush();
    record(file_, 15, std::string(4, '\0'));
    record(file_, 2, std::string(20, '\0'));
    epiline::write(path_, file_ + kMagic);
  }
  bool is_cdr() const override { return is_cdr_; }
  void write(const std::string& topic, std::int64_t ns, RawMessage message) override {
    const auto [at, is_new] = channels_.try_emplace(topic, static_cast<std::uint16_t>(channels_.size() + 1));
    if (is_new) {
      std::string type = message.type;
      if (is_cdr_) type.insert(type.find('/'), "/msg");
      record(chunk_, 3, packed(at->second, type, "ros2msg", "x"));
      record(chunk_, 4, packed(at->second, at->second, topic, is_cdr_ ? "cdr" : "ros1", std::uint32_t{0}));
    }
    const auto time = static_cast<std::uint64_t>(ns);
    const std::string bytes = packing_ == "message" ? zstd_of(message.bytes()) : message.bytes();
    record(chunk_, 5, packed(at->second, std::uint32_t{0}, time, time) + bytes);
    if (chunk_.size() > kChunk) flush();
  }

 private:
  static constexpr const char* kMagic = "\x89MCAP0\r\n";
  static void record(std::string& to, std::uint8_t op, const std::string& content) {
    to += Packer().put(op).block<std::uint64_t>(content).bytes;
  }
  void flush() {
    const bool packs = packing_ == "lz4" || packing_ == "zstd";
    if (packing_ == "open" || packing_ == "message") {
      file_ += chunk_;
    } else if (!chunk_.empty()) {
      const std::uint64_t time = 0, size = chunk_.size();
      record(file_, 6,
             packed(time, time, size, std::uint32_t{0}, packs ? packing_ : "") +
                 Packer().block<std::uint64_t>(packed_as(packing_, chunk_)).bytes);
    }
    chunk_.clear();
  }
  fs::path path_;
  std::string packing_, file_, chunk_;
  bool is_cdr_;
  std::map<std::string, std::uint16_t> channels_;
};

/// SQLite, as ROS 2 wrote by default until Humble. `packs`: zstd for each message.
class Db3Writer final : public BagWriter {
 public:
  explicit Db3Writer(const fs::path& path, bool packs = false) : packs_(packs) {
    fs::create_directories(path.parent_path());
    fs::remove(path);
    EXPECT_EQ(sqlite3_open(path.c_str(), &database_), SQLITE_OK);
    run("PRAGMA synchronous=OFF; BEGIN; CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT "
        "NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL); CREATE TABLE messages(id "
        "INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL); CREATE INDEX "
        "timestamp_idx ON messages (timestamp ASC);");
    sqlite3_prepare_v2(database_, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?,?,?)", -1, &insert_,
                       nullptr);
  }
  ~Db3Writer() override {
    sqlite3_finalize(insert_);
    run("COMMIT");
    sqlite3_close(database_);
  }
  bool is_cdr() const override { return true; }
  void write(const std::string& topic, std::int64_t ns, RawMessage message) override {
    const auto [at, is_new] = topics_.try_emplace(topic, static_cast<int>(topics_.size() + 1));
    if (is_new) {
      std::string type = message.type;
      type.insert(type.find('/'), "/msg");
      run("INSERT INTO topics VALUES(" + std::to_string(at->second) + ",'" + topic + "','" + type + "','cdr','')");
    }
    const std::string bytes = packs_ ? zstd_of(message.bytes()) : message.bytes();
    sqlite3_reset(insert_);
    sqlite3_bind_int(insert_, 1, at->second);
    sqlite3_bind_int64(insert_, 2, ns);
    sqlite3_bind_blob(insert_, 3, bytes.data(), static_cast<int>(bytes.size()), SQLITE_TRANSIENT);
    EXPECT_EQ(sqlite3_step(insert_), SQLITE_DONE);
  }

 private:
  void run(const std::string& text) {
    EXPECT_EQ(sqlite3_exec(database_, text.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << text;
  }
  bool packs_;
  sqlite3* database_ = nullptr;
  sqlite3_stmt* insert_ = nullptr;
  std::map<std::string, int> topics_;
};

/// The folder of a ROS 2 bag in two files, divided in time, with their list. `ending`: .db3 or .mcap.
class SplitWriter final : public BagWriter {
 public:
  SplitWriter(const fs::path& folder, const std::string& ending, std::int64_t second_from_ns)
      : second_from_ns_(second_from_ns) {
    std::string list = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n";
    for (const char* part : {"split_0", "split_1"}) {
      const std::string name = part + ending;
      list += "    - " + name + "\n";
      if (ending == ".db3") parts_.push_back(std::make_unique<Db3Writer>(folder / name));
      if (ending == ".mcap") parts_.push_back(std::make_unique<McapWriter>(folder / name, "zstd"));
    }
    epiline::write(folder / "metadata.yaml", list);
  }
  bool is_cdr() const override { return true; }
  void write(const std::string& topic, std::int64_t ns, RawMessage message) override {
    parts_[ns < second_from_ns_ ? 0 : 1]->write(topic, ns, std::move(message));
  }

 private:
  std::int64_t second_from_ns_;
  std::vector<std::unique_ptr<BagWriter>> parts_;
};

}  // namespace epiline

// ROS 2 bags in SQLite: the tables `topics` and `messages`.
#include <sqlite3.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "drivers/flights/recordings/bag_reader.h"

namespace epiline {

namespace {

namespace fs = std::filesystem;

class Statement {
 public:
  Statement(sqlite3* database, const char* text) { sqlite3_prepare_v2(database, text, -1, &statement_, nullptr); }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  bool row() { return statement_ != nullptr && sqlite3_step(statement_) == SQLITE_ROW; }
  std::int64_t number(int column) { return sqlite3_column_int64(statement_, column); }
  std::string text(int column) {
    const auto* bytes = sqlite3_column_text(statement_, column);
    return bytes == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(bytes));
  }
  std::span<const std::uint8_t> bytes(int column) {
    const auto* bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_, column));
    return {bytes, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
  }
  sqlite3_stmt* get() const { return statement_; }

 private:
  sqlite3_stmt* statement_ = nullptr;
};

/// SQLite takes these letters for itself.
std::string address_of(const fs::path& path, const char* option) {
  std::string address = "file:";
  for (const char letter : path.string())
    address += letter == '%' ? "%25" : letter == '?' ? "%3f" : letter == '#' ? "%23" : std::string(1, letter);
  return address + option;
}

class Db3File final : public BagReader {
 public:
  explicit Db3File(fs::path path) : path_(std::move(path)) {}
  ~Db3File() override {
    one_.reset();
    sqlite3_close(database_);
  }

  Status open() {
    std::error_code ignored;
    const bool has_journal = fs::exists(path_.string() + "-wal", ignored);
    const std::string address = address_of(path_, has_journal ? "" : "?immutable=1");
    if (sqlite3_open_v2(address.c_str(), &database_, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr) != SQLITE_OK)
      return damaged();
    // the file is a stranger's: it runs nothing, and no value is larger than the file
    sqlite3_db_config(database_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    constexpr std::uintmax_t kMost = 1 << 30;
    sqlite3_limit(database_, SQLITE_LIMIT_LENGTH, static_cast<int>(std::min(kMost, fs::file_size(path_, ignored))));
    // without this, a file that was cut short is not read at all
    sqlite3_exec(database_, "PRAGMA writable_schema=1", nullptr, nullptr, nullptr);
    Statement tables(database_,
                     "SELECT count(*) FROM sqlite_master WHERE type='table' AND name IN ('topics','messages') AND sql "
                     "LIKE 'CREATE TABLE%'");
    if (!tables.row() || tables.number(0) != 2) return damaged();
    Statement topics(database_, "SELECT id, name, type, serialization_format FROM topics");
    while (topics.row()) topic_of_[topics.number(0)] = add_topic({topics.text(1), topics.text(2), topics.text(3)});
    return Done{};
  }

  Status scan(const See& see) override {
    Statement messages(database_, "SELECT rowid, topic_id, timestamp, data FROM messages");
    std::uint64_t count = 0;
    for (; messages.row(); ++count) {
      const auto topic = topic_of_.find(messages.number(1));
      if (topic == topic_of_.end()) continue;
      const auto bytes = messages.bytes(3);
      const BagPlace place{0, 0, static_cast<std::uint64_t>(messages.number(0)), bytes.size()};
      see({topic->second, messages.number(2), bytes, place});
    }
    const int end = sqlite3_errcode(database_);
    if (end == SQLITE_DONE || end == SQLITE_OK) return Done{};
    if (count == 0) return damaged();
    note_ = path_.string() + ": ends early, as after an interruption: read up to message " + std::to_string(count);
    return Done{};
  }

  Result<std::span<const std::uint8_t>> read(const BagPlace& place) override {
    if (!one_) one_ = std::make_unique<Statement>(database_, "SELECT data FROM messages WHERE rowid=?");
    sqlite3_reset(one_->get());
    sqlite3_bind_int64(one_->get(), 1, static_cast<sqlite3_int64>(place.offset));
    if (!one_->row()) return damaged();
    return one_->bytes(0);
  }

 private:
  Error damaged() const {
    const std::string reason = database_ == nullptr ? "no memory" : sqlite3_errmsg(database_);
    const bool is_other = reason == "not an error" || reason == "no more rows available";
    return {ErrorKind::kUsage, path_.string(), 0,
            "cannot be read as a bag (" + (is_other ? "SQLite without the tables topics and messages" : reason) + ")",
            "a ROS 2 bag"};
  }

  fs::path path_;
  sqlite3* database_ = nullptr;
  std::unique_ptr<Statement> one_;
  std::map<std::int64_t, std::size_t> topic_of_;
};

}  // namespace

Result<std::unique_ptr<BagReader>> db3_reader(const fs::path& path) {
  auto reader = std::make_unique<Db3File>(path);
  if (const Status s = reader->open(); !s) return s.error();
  return std::unique_ptr<BagReader>(std::move(reader));
}

}  // namespace epiline

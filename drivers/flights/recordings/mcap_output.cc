#include "drivers/flights/recordings/mcap_output.h"

#include <zlib.h>
#include <zstd.h>

#include <utility>

#include "drivers/flights/recordings/byte_writer.h"
#include "drivers/flights/recordings/mcap_records.h"

namespace epiline {

namespace {

constexpr std::size_t kChunk = 1 << 20;  // a reader unpacks a whole one for each message it wants

std::string record(std::uint8_t op, std::string_view content) {
  return ByteWriter().number(op).block<std::uint64_t>(content).bytes();
}

std::uint32_t sum_of(std::string_view bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<z_size_t>(bytes.size())));
}

/// A map of numbers, as MCAP writes it: preceded by its size in bytes.
std::string map_of(const std::map<std::uint16_t, std::uint64_t>& numbers) {
  ByteWriter pairs;
  for (const auto& [key, value] : numbers) pairs.number(key).number(value);
  return ByteWriter().text(pairs.bytes()).bytes();
}

}  // namespace

McapOutput::McapOutput(std::filesystem::path path) : path_(std::move(path)) {
  std::error_code ignored;
  std::filesystem::create_directories(path_.parent_path(), ignored);
  file_.open(path_, std::ios::binary);
  put(kMcapMagic);
  put_record(kMcapHeader, ByteWriter().text("ros2").text("epiline").bytes());
  file_.flush();
}

Status McapOutput::status() const {
  if (file_) return Done{};
  return Error{ErrorKind::kUsage, path_.string(), 0, "cannot be written", "the name of a file, and room on the disk"};
}

void McapOutput::put(std::string_view bytes) {
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  at_ += bytes.size();
  sum_ = sum_of(bytes, sum_);
}

void McapOutput::put_record(std::uint8_t op, std::string_view content) { put(record(op, content)); }

std::uint16_t McapOutput::add_channel(const std::string& topic, const std::string& type, std::string_view definition) {
  const auto number = static_cast<std::uint16_t>(counts_.size() + 1);
  const auto [schema, is_new] = schemas_.try_emplace(type, static_cast<std::uint16_t>(schemas_.size() + 1));
  std::string records;
  if (is_new) {
    records =
        record(kMcapSchema, ByteWriter().number(schema->second).text(type).text("ros2msg").text(definition).bytes());
    schema_records_ += records;
  }
  const std::string qos = ByteWriter().text("offered_qos_profiles").text("").bytes();
  const std::string channel = record(
      kMcapChannel, ByteWriter().number(number).number(schema->second).text(topic).text("cdr").text(qos).bytes());
  channel_records_ += channel;
  chunk_ += records + channel;
  counts_[number] = 0;
  return number;
}

void McapOutput::write(std::uint16_t channel, std::int64_t ns, std::string_view message) {
  const auto time = static_cast<std::uint64_t>(ns);
  const auto sequence = static_cast<std::uint32_t>(counts_[channel]++);
  entries_[channel].push_back({time, chunk_.size()});
  chunk_times_.add(time);
  ByteWriter head;
  head.number(channel).number(sequence).number(time).number(time);
  chunk_ += ByteWriter()
                .number<std::uint8_t>(kMcapMessage)
                .number(std::uint64_t{head.bytes().size() + message.size()})
                .bytes();
  chunk_.append(head.bytes()).append(message);
  if (chunk_.size() >= kChunk) flush();
}

void McapOutput::flush() {
  if (entries_.empty()) return;
  std::string packed(ZSTD_compressBound(chunk_.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), chunk_.data(), chunk_.size(), 1));
  ChunkIndex index{chunk_times_.first_ns, chunk_times_.last_ns, at_, 0, 0, packed.size(), chunk_.size(), {}};
  put_record(kMcapChunk, ByteWriter()
                             .number(index.first_ns)
                             .number(index.last_ns)
                             .number(index.unpacked)
                             .number(sum_of(chunk_))
                             .text("zstd")
                             .block<std::uint64_t>(packed)
                             .bytes());
  index.size = at_ - index.start;
  for (const auto& [channel, entries] : entries_) {
    index.index_starts[channel] = at_;
    ByteWriter pairs;
    for (const Entry& entry : entries) pairs.number(entry.ns).number(entry.offset);
    put_record(kMcapMessageIndex, ByteWriter().number(channel).text(pairs.bytes()).bytes());
  }
  index.index_size = at_ - index.start - index.size;
  times_.add(index.first_ns);
  times_.add(index.last_ns);
  chunks_.push_back(std::move(index));
  chunk_.clear();
  entries_.clear();
  chunk_times_ = {};
}

std::string McapOutput::statistics() const {
  std::uint64_t messages = 0;
  for (const auto& [channel, count] : counts_) messages += count;
  constexpr std::uint32_t kNoAttachments = 0, kNoMetadata = 0;
  return ByteWriter()
             .number(messages)
             .number(static_cast<std::uint16_t>(schemas_.size()))
             .number(static_cast<std::uint32_t>(counts_.size()))
             .number(kNoAttachments)
             .number(kNoMetadata)
             .number(static_cast<std::uint32_t>(chunks_.size()))
             .number(messages > 0 ? times_.first_ns : 0)
             .number(times_.last_ns)
             .bytes() +
         map_of(counts_);
}

Status McapOutput::finish() {
  flush();
  put_record(kMcapDataEnd, ByteWriter().number(sum_).bytes());
  const std::uint64_t summary = at_;
  sum_ = 0;
  std::string chunk_records;
  for (const ChunkIndex& c : chunks_) {
    const std::string head = ByteWriter().number(c.first_ns).number(c.last_ns).number(c.start).number(c.size).bytes();
    const std::string tail = ByteWriter().number(c.index_size).text("zstd").number(c.packed).number(c.unpacked).bytes();
    chunk_records += record(kMcapChunkIndex, head + map_of(c.index_starts) + tail);
  }
  std::string offsets;
  const auto put_group = [&](McapRecord op, const std::string& records) {
    if (records.empty()) return;
    const std::uint64_t start = at_;
    put(records);
    offsets +=
        record(kMcapSummaryOffset,
               ByteWriter().number<std::uint8_t>(op).number(start).number(std::uint64_t{records.size()}).bytes());
  };
  put_group(kMcapSchema, schema_records_);
  put_group(kMcapChannel, channel_records_);
  put_group(kMcapStatistics, record(kMcapStatistics, statistics()));
  put_group(kMcapChunkIndex, chunk_records);
  const std::uint64_t summary_offsets = at_;
  put(offsets);
  // the checksum covers the footer up to itself
  constexpr std::uint64_t kFooterSize = 8 + 8 + 4;
  put(ByteWriter()
          .number<std::uint8_t>(kMcapFooter)
          .number(kFooterSize)
          .number(summary)
          .number(summary_offsets)
          .bytes());
  put(ByteWriter().number(sum_).bytes());
  put(kMcapMagic);
  file_.close();
  return status();
}

}  // namespace epiline

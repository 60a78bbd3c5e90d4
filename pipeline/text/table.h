#pragma once
// Text files of numbers: read whole (gunzipped if need be), parsed line by line, every complaint with file and line.
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/text/time_column.h"
#include "platform/error/result.h"

namespace epiline {

/// The bytes of a file; a gzipped one is unpacked whatever its name, and a text in UTF-16 (by its mark) becomes UTF-8.
/// Fails if and only if it cannot be opened or read to its end, or its gzip stream is damaged or cut short.
Result<std::string> read_text(const std::filesystem::path& path);

/// Replaces the file. A reader finds the whole old text or the whole new one, also after a power cut. Keeps owner and
/// permissions. If the new text cannot be written to its end, it fails and leaves the old file.
Status write_text(const std::filesystem::path& path, const std::string& text);

/// Makes the folder and those above it where they do not exist. Fails if and only if that is impossible.
Status make_folder(const std::filesystem::path& folder);

/// `folder/name`, or `folder/name.gz` if only that exists; empty if neither does.
std::filesystem::path find_table(const std::filesystem::path& folder, const std::string& name);

/// The lines of a text without blank ones, comments (`#`) and carriage returns.
class LineReader {
 public:
  /// `text` must outlive the reader.
  explicit LineReader(std::string_view text);
  bool next(std::string_view& line);
  /// Of the line last given, counted from 1.
  int number() const { return number_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

/// Takes the next value off `line`; values are separated by one comma or semicolon, or by blanks. False at the end of
/// the line.
bool take_field(std::string_view& line, std::string_view& field);

/// Whether no value of the line is a number: names of columns, without the `#` in front.
bool is_header(std::string_view line);

/// The beginning of the text in quotes, for messages.
std::string quoted(std::string_view text);

/// The whole field as a number; nan and inf are numbers here. False otherwise.
bool parse_number(std::string_view field, double& value);
bool parse_number(std::string_view field, std::int64_t& value);

/// Rows of a time and `columns` numbers.
struct NumberTable {
  std::size_t columns = 0;
  std::vector<std::int64_t> time_ns;
  std::vector<double> values;      ///< row-major
  std::vector<std::string> notes;  ///< for the user: an unusual unit or order
  const double* row(std::size_t i) const { return values.data() + i * columns; }
  std::size_t rows() const { return time_ns.size(); }
  /// Row i becomes what row order[i] was. Empty: nothing changes.
  void sort(const std::vector<std::size_t>& order);
};

/// Parses a text of the file `name`. Fails if and only if a field is no number, or a line has not as many values (time
/// included) as the first, or that number is none of `widths`. `what` names a row in the message, for instance "IMU
/// sample". Tables but those of plain nanoseconds may begin with a header without `#`; those of sensors are put in the
/// order of time (order_of_time()).
Result<NumberTable> parse_table(std::string_view text, const std::string& name, TimeColumn time,
                                const std::vector<std::size_t>& widths, const std::string& what);

}  // namespace epiline

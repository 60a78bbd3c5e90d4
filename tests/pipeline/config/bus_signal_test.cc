#include "pipeline/config/bus_signal.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

/// The text of the signal that was read, or what was expected.
std::string read_back(const std::string& text) {
  const auto read = bus_signal_from(text);
  return std::holds_alternative<BusSignal>(read) ? to_text(std::get<BusSignal>(read)) : std::get<std::string>(read);
}

TEST(BusSignalText, IsThatOfADbcFile) {
  const BusSignal s = std::get<BusSignal>(bus_signal_from("291 7|16@0- (0.01,-2.5)"));
  EXPECT_EQ(s.id, 291U);
  EXPECT_FALSE(s.extended);
  EXPECT_EQ(s.start_bit, 7);
  EXPECT_EQ(s.length, 16);
  EXPECT_TRUE(s.big_endian && s.is_signed);
  EXPECT_EQ(s.scale, 0.01);
  EXPECT_EQ(s.offset, -2.5);
  const BusSignal other = std::get<BusSignal>(bus_signal_from(" 0x7FF  16 | 12 @ 1 + ( 1E-2 , 0 ) "));
  EXPECT_EQ(other.id, 0x7ffU);
  EXPECT_FALSE(other.extended || other.big_endian || other.is_signed);
  EXPECT_EQ(std::get<BusSignal>(bus_signal_from("")).length, 0);
  EXPECT_EQ(to_text({}), "");
}

/// By its size, or by bit 31, as DBC files mark it.
TEST(BusSignalText, AnIdentifierMayHave29Bits) {
  for (const std::string id : {"2566853172", "419369524", "0x18ff1234", "0x98ff1234"}) {
    const BusSignal s = std::get<BusSignal>(bus_signal_from(id + " 0|8@1+ (1,0)"));
    EXPECT_EQ(s.id, 0x18ff1234U) << id;
    EXPECT_TRUE(s.extended) << id;
  }
  EXPECT_EQ(read_back("0x80000123 0|8@1+ (1,0)"), "2147483939 0|8@1+ (1,0)");
  EXPECT_FALSE(std::get<BusSignal>(bus_signal_from("0x123 0|8@1+ (1,0)")).extended);
  EXPECT_EQ(read_back("0x20000000 0|8@1+ (1,0)").find("an identifier up to 536870911"), 0U);
  EXPECT_EQ(read_back("0xa0000000 0|8@1+ (1,0)").find("an identifier up to"), 0U);
}

TEST(BusSignalText, OtherTextsAreRefused) {
  for (const char* const text : {" ", "291", "291 7|16@0 (0.01,0)", "291 7|16@2- (0.01,0)", "291 7|16@0- (0.01)",
                                 "291 7|16@0- (0.01,0) m/s", "x 7|16@0- (0.01,0)", "-1 7|16@0- (0.01,0)",
                                 "4294967296 7|16@0- (0.01,0)", "291 7 16@0- (0.01,0)", "SG_ Speed : 7|16@0- (0.01,0)"})
    EXPECT_EQ(read_back(text), kBusSignalForm) << text;
  for (const char* const place :
       {"0|0@1+", "0|65@1+", "-1|8@1+", "505|8@1+", "505|8@0+", "512|1@0+", "2147483647|64@1+"})
    EXPECT_EQ(read_back(std::string("1 ") + place + " (1,0)"), "a signal of 1 to 64 bits within 64 bytes") << place;
  EXPECT_EQ(read_back("1 504|8@1+ (1,0)"), "1 504|8@1+ (1,0)");
  EXPECT_EQ(read_back("1 511|8@0+ (1,0)"), "1 511|8@0+ (1,0)");
  for (const char* const scale : {"(0,0)", "(nan,0)", "(inf,0)", "(1,inf)"})
    EXPECT_EQ(read_back(std::string("1 0|8@1+ ") + scale), "finite numbers, the scale not 0") << scale;
}

}  // namespace
}  // namespace epiline

#include <algorithm>
#include <filesystem>
#include <random>

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  LineReader reader(text);
  while (const auto line = reader.next()) lines.emplace_back(*line);
  EXPECT_EQ(reader.line(), static_cast<int>(lines.size()));
  return lines;
}

std::vector<std::string> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> fields{"left over"};
  split_fields(line, separator, fields);
  return {fields.begin(), fields.end()};
}

using Texts = std::vector<std::string>;

TEST(LineReader, TakesTheLineEndsOfAllSystems) {
  EXPECT_EQ(lines_of("a\nb\n"), (Texts{"a", "b"}));
  EXPECT_EQ(lines_of("a\r\nb\r\n"), (Texts{"a", "b"}));
  EXPECT_EQ(lines_of("a\rb\r"), (Texts{"a", "b"}));
  EXPECT_EQ(lines_of("a\r\n\nb"), (Texts{"a", "", "b"})) << "empty lines count";
  EXPECT_EQ(lines_of(""), Texts{});
}

TEST(SplitFields, AtBlanksTakesRunsAndAtOtherSeparatorsEveryOne) {
  EXPECT_EQ(fields_of("  1 \t 2  3 ", ' '), (Texts{"1", "2", "3"}));
  EXPECT_EQ(fields_of("1, ,\" a b \"", ','), (Texts{"1", "", "a b"}));
  EXPECT_EQ(fields_of("", ','), Texts{""});
  EXPECT_EQ(fields_of(" \t ", ' '), Texts{});
}

TEST(SplitFields, JoiningWhatWasSplitGivesTheLine) {
  std::mt19937 random(3);
  int split = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::string line;
    const int length = static_cast<int>(random() % 12);
    for (int k = 0; k < length; ++k) line += "ab;"[random() % 3];
    std::string joined;
    for (const std::string& field : fields_of(line, ';'))
      joined += (joined.empty() ? "" : ";") + field;
    // The loop above cannot tell an empty first field from none: the number of separators can.
    EXPECT_EQ(fields_of(line, ';').size(),
              static_cast<std::size_t>(std::count(line.begin(), line.end(), ';')) + 1);
    if (!line.empty() && line.front() != ';') {
      EXPECT_EQ(joined, line);
      ++split;
    }
  }
  EXPECT_GT(split, 100);
}

TEST(SeparatorOf, PrefersSemicolonsSoThatDecimalCommasSurvive) {
  EXPECT_EQ(separator_of("1,5;2,5"), ';');
  EXPECT_EQ(separator_of("1,5\t2,5"), '\t');
  EXPECT_EQ(separator_of("1,2"), ',');
  EXPECT_EQ(separator_of("1 2"), ' ');
}

TEST(ParseNumber, TakesWholeFiniteNumbersOnly) {
  EXPECT_EQ(parse_number("-1.5e-3"), -1.5e-3);
  EXPECT_EQ(parse_number("+2"), 2.0);
  for (const char* text : {"", "+", "+-1", "1,5", "1.5mm", " 1", "nan", "inf", "1e999"}) {
    EXPECT_FALSE(parse_number(text)) << text;
  }
}

TEST(ParseWholeNumber, CountsTwelvePointZeroButNotTwelveAndAHalf) {
  EXPECT_EQ(parse_whole_number("12.0"), 12);
  EXPECT_EQ(parse_whole_number("-7"), -7);
  EXPECT_EQ(parse_whole_number("9007199254740993"), 9007199254740993) << "beyond doubles";
  for (const char* text : {"12.5", "1e18", "", "a", "99999999999999999999"}) {
    EXPECT_FALSE(parse_whole_number(text)) << text;
  }
}

TEST(Trimmed, LeavesLineEndsToTrimmedLines) {
  EXPECT_EQ(trimmed(" \ta b\v "), "a b");
  EXPECT_EQ(trimmed("a\n"), "a\n");
  EXPECT_EQ(trimmed_lines("\r\n a\n"), "a");
  EXPECT_EQ(trimmed(" "), "");
}

TEST(LowerCase, IsAsciiOnly) { EXPECT_EQ(lower_case("AZ\xC3\x84z"), "az\xC3\x84z"); }

TEST(QuotedValue, FitsAnErrorOfOneLine) {
  EXPECT_EQ(quoted_value("a\nb\t"), "a?b?");
  EXPECT_EQ(quoted_value(std::string(40, 'x')), std::string(40, 'x'));
  EXPECT_EQ(quoted_value(std::string(41, 'x')), std::string(40, 'x') + "...");
  EXPECT_EQ(at_line("a.swc", 3), "a.swc:3");
}

TEST(PlainText, DropsAByteOrderMarkAndRefusesWhatIsNoText) {
  EXPECT_EQ(plain_text("\xEF\xBB\xBF"
                       "1",
                       "f")
                .value(),
            "1");
  EXPECT_EQ(plain_text("\xFF\xFE"
                       "1",
                       "f")
                .error()
                .what,
            "is UTF-16 text");
  EXPECT_EQ(plain_text(" \n", "f").error().what, "is empty");
  EXPECT_EQ(plain_text(std::string_view("a\0b", 3), "f").error().what,
            "is not text: byte 1 is zero");
}

TEST(ReadBytes, SaysWhyAFileCannotBeRead) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("text_file_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(write_file(folder / "ten", "0123456789"));
  ASSERT_TRUE(write_file(folder / "none", ""));
  EXPECT_EQ(read_bytes(folder / "ten").value(), "0123456789");
  EXPECT_EQ(read_bytes(folder / "ten", 10).value().size(), 10u);
  EXPECT_EQ(read_bytes(folder / "ten", 9).error().what, "is too large");
  EXPECT_EQ(read_bytes(folder / "missing").error().what, "no such file");
  EXPECT_EQ(read_bytes(folder).error().what, "is a folder, not a file");
  EXPECT_EQ(read_text_file(folder / "none").error().what, "is empty");
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace angiospline

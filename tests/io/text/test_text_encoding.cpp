#include <random>

#include <gtest/gtest.h>

#include "io/text/text_encoding.h"

namespace angiospline {
namespace {

constexpr std::size_t kAll = 1000;

TEST(Base64, IsThatOfItsStandard) {  // RFC 4648, section 10
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(Base64, GivesBackAllBytes) {
  std::mt19937 random(5);
  for (std::size_t length = 0; length < 200; ++length) {
    std::string bytes(length, '\0');
    for (char& c : bytes) c = static_cast<char>(random() % 256);
    const std::string text = base64(bytes);
    EXPECT_EQ(text.size(), (length + 2) / 3 * 4);
    EXPECT_EQ(base64_decoded(text, kAll), bytes);
    EXPECT_EQ(base64_decoded(text, length / 2), bytes.substr(0, length / 2));
  }
}

TEST(Base64, ReadsGroupsThatFollowEachOtherAsVtkWritesThem) {
  EXPECT_EQ(base64_decoded(base64("head") + base64("data"), kAll), "headdata");
  EXPECT_EQ(base64_decoded(" Zm9v\r\n\tYmFy ", kAll), "foobar");
  EXPECT_EQ(base64_decoded("Zm9v*YmFy", kAll), "foo") << "stops where no digit stands";
}

TEST(ValidUtf8, KeepsWhatIsWellFormedAndReplacesEachWrongByte) {
  EXPECT_EQ(valid_utf8("a\xC3\xA4\xE2\x82\xAC\xF0\x9F\x98\x80"),
            "a\xC3\xA4\xE2\x82\xAC\xF0\x9F\x98\x80");
  EXPECT_EQ(valid_utf8("\xC0\xAF"), "\uFFFD\uFFFD") << "overlong";
  EXPECT_EQ(valid_utf8("\xED\xA0\x80"), "\uFFFD\uFFFD\uFFFD") << "a surrogate";
  EXPECT_EQ(valid_utf8("a\xE2\x82"), "a\uFFFD\uFFFD") << "cut short";
}

TEST(Word, IsOneWordThatStartsWithALetter) {
  EXPECT_EQ(word("a b/c"), "a_b_c");
  EXPECT_EQ(word("3d"), "_3d");
  EXPECT_EQ(word("-x.1"), "_-x.1");
  EXPECT_EQ(word(""), "_");
}

}  // namespace
}  // namespace angiospline

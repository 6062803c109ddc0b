#include <csignal>
#include <fstream>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/atomic_file.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

// A folder of its own for each test; the name of the running test makes parallel runs safe.
class AtomicFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::temp_directory_path() / ("atomic_file_" + std::to_string(::getpid()) + "_" +
                                     testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  int entries() const {
    return static_cast<int>(
        std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

TEST_F(AtomicFile, WritesAndReplacesAndLeavesNothingElse) {
  const std::string bytes("a\0b\n", 4);
  ASSERT_TRUE(write_file(folder_ / "x.json", "old"));
  ASSERT_TRUE(write_file(folder_ / "x.json", bytes));
  EXPECT_EQ(*read_file(folder_ / "x.json"), bytes);
  EXPECT_EQ(entries(), 1);
}

TEST_F(AtomicFile, AWriterThatFailsLeavesTheOldFile) {
  ASSERT_TRUE(write_file(folder_ / "x.step", "old"));
  const auto result = write_atomically(folder_ / "x.step", [&](const fs::path& temporary) {
    EXPECT_EQ(temporary.filename(), "x.step");
    std::ofstream(temporary) << "half";
    return Result<void>(fail({ErrorKind::kFailed, "no", {}, {}, {}}));
  });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().what, "no");
  EXPECT_EQ(*read_file(folder_ / "x.step"), "old");
  EXPECT_EQ(entries(), 1);
}

TEST_F(AtomicFile, AWriterThatThrowsLeavesNothing) {
  EXPECT_THROW((void)write_atomically(folder_ / "x.step",
                                      [](const fs::path& temporary) -> Result<void> {
                                        std::ofstream(temporary) << "half";
                                        throw std::bad_alloc();
                                      }),
               std::bad_alloc);
  EXPECT_EQ(entries(), 0);
}

TEST_F(AtomicFile, AWriterThatWritesNothingIsAnError) {
  const auto result =
      write_atomically(folder_ / "x.step", [](const fs::path&) { return Result<void>(); });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kCannotWrite);
  EXPECT_EQ(entries(), 0);
}

TEST_F(AtomicFile, ADiskThatIsFullIsAnErrorAndLeavesTheOldFile) {
  ASSERT_TRUE(write_file(folder_ / "x.json", "old"));
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 1000;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const auto result = write_file(folder_ / "x.json", std::string(100000, 'x'));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kCannotWrite);
  EXPECT_NE(result.error().message().find("x.json"), std::string::npos);
  EXPECT_EQ(*read_file(folder_ / "x.json"), "old");
  EXPECT_EQ(entries(), 1);
}

TEST_F(AtomicFile, AFullDeviceIsAnErrorAndStaysADevice) {
  const auto result = write_file("/dev/full", "bytes");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kCannotWrite);
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
  EXPECT_TRUE(write_file("/dev/null", "bytes"));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(AtomicFile, NamesAMissingFolderAndAFolderInItsPlace) {
  const auto missing = write_file(folder_ / "none" / "x.json", "bytes");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().what, "the folder does not exist");
  const auto in_place = write_file(folder_, "bytes");
  ASSERT_FALSE(in_place);
  EXPECT_EQ(in_place.error().what, "a folder is in the place of the file");
  EXPECT_EQ(entries(), 0);
}

TEST_F(AtomicFile, ALinkStaysALink) {
  ASSERT_TRUE(write_file(folder_ / "real", "old"));
  fs::create_symlink(folder_ / "real", folder_ / "link");
  ASSERT_TRUE(write_file(folder_ / "link", "new"));
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(*read_file(folder_ / "real"), "new");
}

TEST_F(AtomicFile, ReadingNamesWhatIsMissing) {
  const auto result = read_file(folder_ / "none.json");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kBadInput);
  EXPECT_EQ(result.error().message(),
            (folder_ / "none.json").string() + ": No such file or directory");
  EXPECT_FALSE(read_file(folder_));
}

}  // namespace
}  // namespace angiospline

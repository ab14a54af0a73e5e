#include "service/notes.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace railfix::service {
namespace {

namespace fs = std::filesystem;

TEST(Notes, TheNextProcessReadsWhatThisOneKeptLast) {
  const fs::path path = fs::temp_directory_path() / ("railfix-notes-" + std::to_string(getpid()));
  fs::remove(path);
  {
    Notes notes(path);
    EXPECT_EQ(notes.kept(), "");
    notes.keep("a longer first note");
    notes.keep(std::string("zero\0inside", 11));
    EXPECT_EQ(notes.kept(), "") << "of the process before";
  }
  EXPECT_EQ(Notes(path).kept(), std::string("zero\0inside", 11));
  fs::remove(path);
}

TEST(Notes, WhatCannotBeWrittenIsLeftOut) {
  Notes notes("/nowhere/at/all");
  notes.keep("nothing");
  EXPECT_EQ(Notes("/nowhere/at/all").kept(), "");
}

}  // namespace
}  // namespace railfix::service

// The project's own sources as data, for the tests that hold its shape.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace angiospline::source_tree {

struct File {
  std::string path;     // relative to the project's root
  std::string library;  // base, kernel, modeling, imaging, recovery, io, pipeline, cli
  std::string room;     // its folder
  std::vector<std::string> lines;
  std::vector<std::string> includes;  // what its #include lines name

  bool is_header() const { return path.ends_with(".h"); }
};

// Every header and source of the libraries and the command, ordered by path.
const std::vector<File>& files();

// The same of tests and benches.
const std::vector<File>& test_files();

// The file of this path, or nullptr.
const File* find(const std::string& path);

// What a room's CMakeLists.txt lists.
struct Room {
  std::vector<std::string> public_headers;
  std::vector<std::string> private_headers;
  std::vector<std::string> sources;
};

// A library's rooms, lowest first, as the folder's CMakeLists.txt has them.
struct Library {
  std::string folder;
  std::vector<std::string> room_order;  // folders, relative to the project's root
  std::map<std::string, Room> rooms;
};
const std::map<std::string, Library>& libraries();

// A function definition of a source or header.
struct Function {
  std::string file;
  int line = 0;   // of its first line, from 1
  int lines = 0;  // from its first line to its closing brace
  int blank_lines = 0;
  bool has_reason = false;  // a comment "long: ..." stands right above it
};
std::vector<Function> functions();

}  // namespace angiospline::source_tree

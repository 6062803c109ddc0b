// XML as vessel files use it, one event after the other; several root elements are taken.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"

namespace angiospline {

// Elements, attributes, text, CDATA, comments, processing instructions, the five named entities and
// numeric ones. A document type is skipped; one that defines entities is refused, so that nothing
// grows beyond the file. The text stays the caller's and must outlive the reader. O(length) in all.
//
// Why not pugixml: where a VTP file's appended data are raw, what follows is no XML; this reader
// stops there, a parser of whole documents fails. pugixml takes unknown entities, and document
// types that define some, without a word; here they are errors with their line. Expat refuses a
// second root element, which SimVascular's files have.
class XmlReader {
 public:
  enum class Event { kStart, kEnd, kText, kDone };

  XmlReader(std::string_view text, std::string_view name) : text_(text), name_(name) {}

  // An element <a/> is a start and an end. Text between elements that is only space is left out.
  // Errors name file and line: malformed markup, an end without its start, an unknown entity, more
  // than 100 open elements, a file that stops inside an element.
  Result<Event> next();

  std::string_view tag() const { return tag_; }            // of the last start or end
  const std::string& content() const { return content_; }  // of the last text, entities replaced
  std::optional<std::string_view> attribute(std::string_view name) const;  // of the last start
  int line();                                                              // of the last event
  std::size_t depth() const { return open_.size(); }

  // What follows the last event, unparsed (for data that is not XML); `skip` goes on behind it.
  std::string_view rest() const { return text_.substr(at_); }
  void skip(std::size_t count) { at_ += count; }

  // The whole text of the element whose start was the last event, up to and with its end; elements
  // inside are an error.
  Result<std::string> text_of_element();

  tl::unexpected<Error> bad(std::string what, std::string_view value, std::string rule);

 private:
  Result<Event> element();
  Result<bool> skip_markup();
  Result<void> read_attributes(std::string_view inside);
  Result<std::string> decoded(std::string_view raw);

  std::string_view text_;
  std::string_view name_;
  std::size_t at_ = 0;
  std::size_t event_at_ = 0;
  std::size_t counted_at_ = 0;
  int counted_lines_ = 1;
  std::string_view tag_;
  std::string content_;
  std::vector<std::pair<std::string_view, std::string>> attributes_;
  std::vector<std::string_view> open_;
  bool ends_itself_ = false;
};

}  // namespace angiospline

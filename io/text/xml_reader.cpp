#include "io/text/xml_reader.h"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>

#include "io/text/text_file.h"

namespace angiospline {
namespace {

constexpr std::size_t kDeepest = 100;
constexpr std::string_view kBlank = " \t\r\n";

bool is_blank(std::string_view text) {
  return text.find_first_not_of(kBlank) == std::string_view::npos;
}

void append_utf8(std::string& out, unsigned code) {
  const auto byte = [&](unsigned b) { out.push_back(static_cast<char>(b)); };
  if (code < 0x80) {
    byte(code);
  } else if (code < 0x800) {
    byte(0xC0 | code >> 6);
    byte(0x80 | (code & 0x3F));
  } else if (code < 0x10000) {
    byte(0xE0 | code >> 12);
    byte(0x80 | (code >> 6 & 0x3F));
    byte(0x80 | (code & 0x3F));
  } else {
    byte(0xF0 | code >> 18);
    byte(0x80 | (code >> 12 & 0x3F));
    byte(0x80 | (code >> 6 & 0x3F));
    byte(0x80 | (code & 0x3F));
  }
}

}  // namespace

int XmlReader::line() {
  const auto from = text_.begin() + static_cast<std::ptrdiff_t>(counted_at_);
  const auto to = text_.begin() + static_cast<std::ptrdiff_t>(std::max(event_at_, counted_at_));
  counted_lines_ += static_cast<int>(std::count(from, to, '\n'));
  counted_at_ = std::max(event_at_, counted_at_);
  return counted_lines_;
}

tl::unexpected<Error> XmlReader::bad(std::string what, std::string_view value, std::string rule) {
  return fail({ErrorKind::kBadInput, std::move(what), at_line(name_, line()),
               value.empty() ? std::string() : fmt::format("'{}'", quoted_value(value)),
               std::move(rule)});
}

std::optional<std::string_view> XmlReader::attribute(std::string_view name) const {
  for (const auto& [key, value] : attributes_) {
    if (key == name) return value;
  }
  return std::nullopt;
}

Result<XmlReader::Event> XmlReader::next() {
  if (ends_itself_) {
    ends_itself_ = false;
    tag_ = open_.back();
    open_.pop_back();
    return Event::kEnd;
  }
  while (true) {
    event_at_ = at_;
    if (at_ >= text_.size()) {
      if (open_.empty()) return Event::kDone;
      return bad("the file stops inside an element", open_.back(), "every element is closed");
    }

    if (text_[at_] != '<') {
      const std::size_t end = std::min(text_.find('<', at_), text_.size());
      const std::string_view raw = text_.substr(at_, end - at_);
      at_ = end;
      if (is_blank(raw)) continue;
      Result<std::string> plain = decoded(raw);
      if (!plain) return fail(plain.error());
      content_ = std::move(*plain);
      return Event::kText;
    }

    if (text_.substr(at_, 9) == "<![CDATA[") {
      const std::size_t end = text_.find("]]>", at_);
      if (end == std::string_view::npos) return bad("CDATA without an end", {}, "it ends with ]]>");
      content_ = std::string(text_.substr(at_ + 9, end - at_ - 9));
      at_ = end + 3;
      return Event::kText;
    }

    const Result<bool> skipped = skip_markup();
    if (!skipped) return fail(skipped.error());
    if (!*skipped) return element();
  }
}

// Comments, processing instructions and the document type.
Result<bool> XmlReader::skip_markup() {
  std::string_view end;
  const std::string_view rest = text_.substr(at_);
  if (rest.substr(0, 4) == "<!--") {
    end = "-->";
  } else if (rest.substr(0, 2) == "<?") {
    end = "?>";
  } else if (rest.substr(0, 2) == "<!") {
    end = ">";
  } else {
    return false;
  }

  const std::size_t found = rest.find(end, 2);
  if (found == std::string_view::npos) return bad("markup without an end", rest.substr(0, 9), "");
  if (end == ">" && rest.substr(0, found).find('[') != std::string_view::npos) {
    return bad("the document type defines entities", rest.substr(0, 20), "they are not taken");
  }
  at_ += found + end.size();
  return true;
}

Result<XmlReader::Event> XmlReader::element() {
  // '>' may stand inside a quoted attribute.
  std::size_t end = at_ + 1;
  char quote = 0;
  for (; end < text_.size(); ++end) {
    const char c = text_[end];
    if (quote != 0) {
      if (c == quote) quote = 0;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '>') {
      break;
    }
  }
  if (end >= text_.size())
    return bad("a tag without an end", text_.substr(at_, 20), "it ends with >");

  std::string_view inside = text_.substr(at_ + 1, end - at_ - 1);
  at_ = end + 1;
  if (!inside.empty() && inside.front() == '/') {
    inside.remove_prefix(1);
    inside = inside.substr(0, inside.find_last_not_of(kBlank) + 1);
    if (open_.empty() || open_.back() != inside) {
      return bad("an element ends that is not open", inside,
                 "elements end in the order they begin");
    }
    tag_ = inside;
    open_.pop_back();
    return Event::kEnd;
  }

  // An empty element is told as a start and an end.
  if (!inside.empty() && inside.back() == '/') {
    ends_itself_ = true;
    inside.remove_suffix(1);
  }
  const std::size_t name_end = std::min(inside.find_first_of(kBlank), inside.size());
  tag_ = inside.substr(0, name_end);
  if (tag_.empty() || tag_.find_first_of("<=\"'&") != std::string_view::npos) {
    return bad("a tag without a name", inside, "<name attribute=\"value\">");
  }

  if (open_.size() >= kDeepest) {
    return bad("too many open elements", tag_, fmt::format("at most {}", kDeepest));
  }
  open_.push_back(tag_);
  if (auto read = read_attributes(inside.substr(name_end)); !read) return fail(read.error());
  return Event::kStart;
}

Result<void> XmlReader::read_attributes(std::string_view inside) {
  attributes_.clear();
  while (true) {
    const std::size_t first = inside.find_first_not_of(kBlank);
    if (first == std::string_view::npos) return {};
    inside.remove_prefix(first);
    const std::size_t equals = inside.find('=');
    if (equals == std::string_view::npos)
      return bad("an attribute without a value", inside, "name=\"value\"");
    const std::string_view key = inside.substr(0, inside.find_last_not_of(kBlank, equals - 1) + 1);
    inside.remove_prefix(equals + 1);

    const std::size_t open = inside.find_first_not_of(kBlank);
    const char quote = open == std::string_view::npos ? '\0' : inside[open];
    if (equals == 0 || (quote != '"' && quote != '\'')) {
      return bad("an attribute without a quoted value", key, "name=\"value\"");
    }
    const std::size_t close = inside.find(quote, open + 1);
    if (close == std::string_view::npos)
      return bad("an attribute without an end", key, "name=\"value\"");

    Result<std::string> value = decoded(inside.substr(open + 1, close - open - 1));
    if (!value) return fail(value.error());
    attributes_.emplace_back(key, std::move(*value));
    inside.remove_prefix(close + 1);
  }
}

Result<std::string> XmlReader::decoded(std::string_view raw) {
  constexpr std::array<std::pair<std::string_view, char>, 5> kNamed = {
      {{"lt", '<'}, {"gt", '>'}, {"amp", '&'}, {"quot", '"'}, {"apos", '\''}}};
  std::string out;
  while (true) {
    const std::size_t mark = raw.find('&');
    out.append(raw.substr(0, mark));
    if (mark == std::string_view::npos) return out;

    // Entities are short: a text without a semicolon is not searched to its end.
    raw.remove_prefix(mark + 1);
    const std::size_t end = raw.substr(0, 12).find(';');
    const std::string_view entity = raw.substr(0, end == std::string_view::npos ? 8 : end);
    if (end == std::string_view::npos) return bad("an entity without an end", entity, "&name;");

    const auto* const named = std::find_if(kNamed.begin(), kNamed.end(),
                                           [&](const auto& pair) { return pair.first == entity; });
    if (named != kNamed.end()) {
      out.push_back(named->second);
    } else {
      const bool hex = entity.size() > 2 && entity[0] == '#' && entity[1] == 'x';
      const std::string_view digits =
          entity.substr(std::min<std::size_t>(hex ? 2 : 1, entity.size()));
      unsigned code = 0;
      const auto [stop, error] =
          std::from_chars(digits.data(), digits.data() + digits.size(), code, hex ? 16 : 10);
      if (entity.empty() || entity[0] != '#' || error != std::errc{} ||
          stop != digits.data() + digits.size() || code == 0 || code > 0x10FFFF) {
        return bad("an unknown entity", entity, "&lt; &gt; &amp; &quot; &apos; and numbers");
      }
      append_utf8(out, code);
    }
    raw.remove_prefix(end + 1);
  }
}

Result<std::string> XmlReader::text_of_element() {
  std::string all;
  while (true) {
    const Result<Event> event = next();
    if (!event) return fail(event.error());
    if (*event == Event::kEnd) return all;
    if (*event != Event::kText) return bad("an element where text is expected", tag_, "text only");
    all += content_;
  }
}

}  // namespace angiospline

#include "cli/command_line.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

#include <CLI/CLI.hpp>

#include "cli/console.h"

namespace angiospline::cli {
namespace {

// "1.5,-2,30" to a point; CLI11 prints what a ValidationError says.
Vec3 parse_point(const std::string& text) {
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  Vec3 point;
  char comma = ',';
  for (int i = 0; i < 3; ++i) {
    if (i > 0) stream >> comma;
    if (!(stream >> point[i]) || comma != ',' || !std::isfinite(point[i])) {
      throw CLI::ValidationError(text, "a point is three finite numbers: x,y,z");
    }
  }
  if (stream >> comma) throw CLI::ValidationError(text, "a point is three finite numbers: x,y,z");
  return point;
}

constexpr const char* kPointType = "X,Y,Z";

}  // namespace

// ---- Option

Option Option::required() const { return Option(option_->required()); }

Option Option::between(int least, int most) const {
  return Option(option_->check(CLI::Range(least, most)));
}

Option Option::between(double least, double most) const {
  return Option(option_->check(CLI::Range(least, most)));
}

Option Option::positive() const { return Option(option_->check(CLI::PositiveNumber)); }

Option Option::not_negative() const { return Option(option_->check(CLI::NonNegativeNumber)); }

Option Option::one_of(const std::vector<std::string>& words) const {
  return Option(option_->check(CLI::IsMember(words)));
}

Option Option::needs(const Option& other) const { return Option(option_->needs(other.option_)); }

Option Option::excludes(const Option& other) const {
  return Option(option_->excludes(other.option_));
}

// ---- Command

void Command::alias(const std::string& name) const { app_->alias(name); }

Option Command::add(const std::string& name, std::string& target, const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, std::filesystem::path& target,
                    const std::string& help) const {
  return Option(app_->add_option_function<std::string>(
      name, [&target](const std::string& text) { target = text; }, help));
}

Option Command::add(const std::string& name, int& target, const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, std::uint64_t& target, const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, double& target, const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, std::optional<int>& target,
                    const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, std::optional<std::size_t>& target,
                    const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, std::optional<double>& target,
                    const std::string& help) const {
  return Option(app_->add_option(name, target, help));
}

Option Command::add(const std::string& name, std::vector<std::string>& target,
                    const std::string& help) const {
  return Option(app_->add_option_function<std::vector<std::string>>(
      name, [&target](const std::vector<std::string>& texts) { target = texts; }, help));
}

Option Command::add(const std::string& name, Paths& target, const std::string& help) const {
  return Option(app_->add_option_function<std::vector<std::string>>(
      name,
      [&target](const std::vector<std::string>& texts) {
        target.assign(texts.begin(), texts.end());
      },
      help));
}

Option Command::flag(const std::string& name, bool& target, const std::string& help) const {
  return Option(app_->add_flag(name, target, help));
}

Option Command::flag(const std::string& name, const std::function<void()>& found,
                     const std::string& help) const {
  return Option(app_->add_flag_callback(name, found, help));
}

Option Command::text(const std::string& name,
                     const std::function<std::optional<std::string>(const std::string&)>& read,
                     const std::string& help) const {
  return Option(app_->add_option_function<std::string>(
      name,
      [name, read](const std::string& text) {
        if (const auto wrong = read(text)) throw CLI::ValidationError(name, *wrong);
      },
      help));
}

Option Command::point(const std::string& name, const std::function<void(const Vec3&)>& found,
                      const std::string& help) const {
  return Option(app_->add_option_function<std::string>(
                        name, [found](const std::string& text) { found(parse_point(text)); }, help)
                    ->type_name(kPointType));
}

Option Command::points(const std::string& name, Points& target, const std::string& help) const {
  return Option(app_->add_option_function<std::vector<std::string>>(
                        name,
                        [&target](const std::vector<std::string>& texts) {
                          target.clear();
                          for (const std::string& text : texts) target.push_back(parse_point(text));
                        },
                        help)
                    ->type_name(kPointType)
                    ->allow_extra_args(false)
                    ->take_all());
}

Option Command::word(const std::string& name, const std::vector<std::string>& words,
                     const std::string& now, const std::function<void(std::size_t)>& found,
                     const std::string& help) const {
  CLI::Option* option = app_->add_option_function<std::string>(
      name,
      [words, found](const std::string& text) {
        const auto at = std::find(words.begin(), words.end(), text);
        if (at != words.end()) found(static_cast<std::size_t>(at - words.begin()));
      },
      help);
  if (!now.empty()) option->default_str(now);
  return Option(option).one_of(words);
}

void Command::runs(std::function<int()> verb) const {
  app_->callback([chosen = chosen_, verb = std::move(verb)] { *chosen = verb; });
}

// ---- CommandLine

CommandLine::CommandLine(const std::string& program, const std::string& help,
                         const std::string& version)
    : app_(std::make_unique<CLI::App>(help)) {
  app_->name(program);
  app_->set_version_flag("--version", version);
  app_->require_subcommand(1);
  app_->option_defaults()->always_capture_default();
}

CommandLine::~CommandLine() = default;

Command CommandLine::command(const std::string& name, const std::string& help) {
  return Command(app_->add_subcommand(name, help), &chosen_);
}

int CommandLine::run(int argc, const char* const* argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app_->exit(success);
  } catch (const CLI::ParseError& error) {
    std::string help = app_->get_name();
    for (const CLI::App* command : app_->get_subcommands()) help += " " + command->get_name();
    return report_error({ErrorKind::kBadInput, error.what(), {}, {}, "see " + help + " --help"});
  }
  return chosen_();
}

}  // namespace angiospline::cli

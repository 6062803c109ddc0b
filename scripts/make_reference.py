#!/usr/bin/env python3
"""Writes the command reference, the man page and the completions for bash and zsh from what the program says of
itself: `angiospline --help` and `--help` of each subcommand. The four files are committed, and a test compares them
with what this script makes.

Usage: make_reference.py PROGRAM [ROOT]    ROOT is the folder that gets docs/ and cli/ (default: this repository)
"""
import pathlib
import re
import subprocess
import sys
import textwrap

EXIT_CODES = [
    ("0", "what was asked for is there; of a model: closed, valid, and nothing of the input is missing"),
    ("1", "the input is sound, but the result is not all that was asked for: the messages say what is missing or wrong"),
    ("2", "the input or the command line is wrong, or a result could not be written"),
    ("130", "stopped by Ctrl-C or SIGTERM; files are written whole or not at all"),
]
TALK = ("Messages go to standard error, figures and JSON to standard output. A line that starts with `note:` says what "
        "was assumed or chosen, `warning [code]:` what is doubtful about the result, `failed:` what is missing in it. "
        "The codes never change.")


class Option:
    """One line of help, taken apart: names, the kind of value, what limits it, and the text."""

    def __init__(self, head, text):
        self.text = text
        self.positional = not head.startswith("-")
        names, _, rest = head.partition(" ")
        self.names = [re.sub(r"\{.*\}", "", name) for name in names.split(",")]
        # What the option needs and excludes ends the line.
        rest, _, excludes = rest.partition("Excludes:")
        rest, _, needs = rest.partition("Needs:")
        self.needs, self.excludes = needs.split(), excludes.split()
        self.required = "REQUIRED" in rest
        self.repeated = " ..." in " " + rest
        rest = rest.replace("REQUIRED", "").replace("...", "").strip()
        choices = re.search(r":\{([^}]*)\}", rest)
        self.choices = choices.group(1).split(",") if choices else []
        rest = re.sub(r":\{[^}]*\}", "", rest)
        span = re.search(r":\w+ in \[(\S+) - (\S+)\]", rest)
        self.limits = f"{span.group(1)} to {span.group(2)}" if span else ""
        rest = re.sub(r":\w+ in \[[^\]]*\]", "", rest)
        for word, limits in ((":POSITIVE", "above 0"), (":NONNEGATIVE", "0 or more")):
            if word in rest:
                self.limits, rest = limits, rest.replace(word, "")
        value, _, default = rest.partition("=")
        self.value = value.strip()
        # The text says more of a default than its bare value does, where it mentions one.
        self.default = "" if default in ("", "[]", "\"\"") or "default" in text else default

    def takes_file(self):
        return self.value == "TEXT" and not self.choices and self.names[-1] not in (
            "--series", "--format", "--unit", "--name", "TABLE")

    def usage(self):
        if self.positional:
            return self.names[0] + ("..." if self.repeated else "")
        text = ", ".join(self.names)
        return f"{text} {self.value}" if self.value else text

    def remarks(self):
        remarks = []
        if self.choices and not all(choice in self.text for choice in self.choices):
            remarks.append("One of " + ", ".join(self.choices) + ".")
        if self.limits:
            remarks.append(f"Allowed: {self.limits}.")
        if self.default:
            remarks.append(f"Default: {self.default}.")
        if self.required and not self.positional:
            remarks.append("Required.")
        if self.repeated and not self.positional and "repeated" not in self.text:
            remarks.append("May be given several times." if self.value == "X,Y,Z" else "Takes several values.")
        if self.needs:
            remarks.append("Only with " + ", ".join(self.needs) + ".")
        if self.excludes:
            remarks.append("Not with " + ", ".join(self.excludes) + ".")
        return remarks

    def sentences(self):
        text = self.text[0].upper() + self.text[1:] if re.match(r"[a-z]+[ ,]", self.text) else self.text
        return " ".join([text if text.endswith(".") else text + "."] + self.remarks())


class Command:
    """A help page: what the command is for, how it is called, its positionals, options and subcommands."""

    def __init__(self, text, other_names=()):
        self.other_names = list(other_names)
        lines = text.strip("\n").split("\n")
        self.about = lines[0].strip()
        usage = next(k for k, line in enumerate(lines) if line.startswith("Usage:"))
        self.usage = lines[usage].removeprefix("Usage:").strip()
        self.more = [line.strip() for line in lines[1:usage] if line.strip()]
        sections, current = {}, None
        for line in lines[usage + 1:]:
            if re.fullmatch(r"[A-Z][\w ]*:", line):
                current = sections.setdefault(line[:-1], [])
            elif line.strip() and current is not None:
                # An entry stands at column 2 and its text at column 30, on the next line where it does not fit.
                if re.match(r"  \S", line):
                    head, _, text = line.strip().partition("  ")
                    current.append([head.strip(), text.strip()])
                else:
                    current[-1][1] = (current[-1][1] + " " + line.strip()).strip()
        self.positionals = [Option(*entry) for entry in sections.get("Positionals", [])]
        self.options = [Option(*entry) for entry in sections.get("Options", [])]
        self.subcommands = sections.get("Subcommands", [])

    def also_called(self, quote="`"):
        names = ", ".join(quote + name + quote for name in self.other_names)
        return f" Also called {names}." if names else ""


def help_of(program, *names):
    """The help page of the command with these names, or of the program itself without any."""
    said = subprocess.run([program, *names[:1], "--help"], check=True, capture_output=True, text=True).stdout
    return Command(said, names[1:])


def wrapped(text):
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


def code(text):
    return "`" + text + "`"


def cell(text):
    return text.replace("|", "\\|").replace("<", "&lt;")


def reference(app, commands):
    out = ["# Command reference", "",
           wrapped("Generated from the program's own help by `scripts/make_reference.py`; edit the help, not this page. "
                   "The same text is the man page `angiospline(1)`."), "",
           code(app.usage), "", wrapped(TALK + " [troubleshooting.md](troubleshooting.md) explains each of them."), "",
           "| exit code | meaning |", "|---|---|"]
    out += [f"| {number} | {meaning} |" for number, meaning in EXIT_CODES]
    out += ["", "| command | what it does |", "|---|---|"]
    out += [f"| [{c}](#{c}) | {cell(command.about)} |" for c, command in commands.items()]
    for c, command in commands.items():
        out += ["", f"## {c}", "", code(command.usage), "", wrapped(command.about[0].upper() + command.about[1:] + "." + command.also_called())]
        for line in command.more:
            out += ["", wrapped(line)]
        for title, entries in (("argument", command.positionals), ("option", command.options)):
            if entries:
                out += ["", f"| {title} | meaning |", "|---|---|"]
                out += [f"| {code(cell(o.usage()))} | {cell(o.sentences())} |" for o in entries]
    return "\n".join(out) + "\n"


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace("`", "")
    return re.sub(r"(?m)^([.'])", r"\\&\1", text)


def man_page(app, commands, version):
    name, _, about = app.about.partition(": ")
    out = ['.\\" Generated by scripts/make_reference.py from the program\'s own help.',
           f'.TH ANGIOSPLINE 1 "" "angiospline {version}" "User Commands"', ".SH NAME",
           roff(f"angiospline - {about}"), ".SH SYNOPSIS", ".B angiospline", r"[\fIOPTIONS\fR] \fISUBCOMMAND\fR ...",
           ".SH DESCRIPTION", roff(f"{name} turns images and centerlines of blood vessels into CAD models, meshes and reports. Each "
                                      "subcommand does one step of the way, or all of them."), ".PP",
           roff(TALK)]

    def entries(options):
        for o in options:
            names = o.names if not o.positional else [o.usage()]
            font = "\\fI" if o.positional else "\\fB"
            head = ", ".join(font + roff(n) + "\\fR" for n in names)
            if o.value and not o.positional:
                head += f" \\fI{roff(o.value)}\\fR"
            out.extend([".TP", head, roff(o.sentences())])

    out.append(".SH OPTIONS")
    entries(app.options)
    out.append(".SH SUBCOMMANDS")
    for c, command in commands.items():
        out += [f".SS {roff(command.usage)}", roff(command.about[0].upper() + command.about[1:] + "." + command.also_called(""))]
        for line in command.more:
            out += [".PP", roff(line)]
        entries(command.positionals + command.options)
    out.append(".SH EXIT STATUS")
    for number, meaning in EXIT_CODES:
        out += [".TP", f".B {number}", roff(meaning[0].upper() + meaning[1:] + ".")]
    return "\n".join(out) + "\n"


def bash_completion(app, commands):
    out = ["# bash completion for angiospline; generated by scripts/make_reference.py from the program's own help.",
           "_angiospline() {", "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} command= k",
           "  COMPREPLY=()", "  for ((k = 1; k < COMP_CWORD; ++k)); do",
           "    if [[ ${COMP_WORDS[k]} != -* ]]; then command=${COMP_WORDS[k]}; break; fi", "  done",
           "  local words= values=", "  case $command in"]
    every = [name for c, command in commands.items() for name in [c, *command.other_names]]
    top = " ".join(every + [n for o in app.options for n in o.names])
    out.append(f"    '') words='{top}' ;;")
    for c, command in commands.items():
        out.append(f"    {'|'.join([c, *command.other_names])})")
        out.append(f"      words='{' '.join(n for o in command.options for n in o.names)}'")
        cases = [(("|".join(o.names)), o) for o in command.options if o.choices]
        if cases:
            out.append("      case $before in")
            out += [f"        {names}) values='{' '.join(o.choices)}' ;;" for names, o in cases]
            out.append("      esac")
        for o in command.positionals:
            if o.choices:
                out.append(f"      if [[ $before == $command && $word != -* ]]; then values='{' '.join(o.choices)}'; fi")
        out.append("      ;;")
    out += ["  esac",
            "  # Where nothing is offered, the shell completes names of files.",
            "  if [[ -n $values ]]; then", '    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$word")',
            "  elif [[ -z $command || $word == -* ]]; then",
            '    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")', "  fi", "}",
            "complete -o default -F _angiospline angiospline"]
    return "\n".join(out) + "\n"


def zsh_text(text):
    return re.sub(r"([\[\]:\\])", r"\\\1", text).replace("'", "'\\''")


def zsh_completion(app, commands):
    def action(o):
        if o.choices:
            return ":value:(" + " ".join(o.choices) + ")"
        if o.takes_file():
            return ":file:_files"
        return f":{zsh_text(o.value)}: " if o.value else ""

    def specs(command):
        lines = []
        for o in command.options:
            several = "*" if o.repeated else ""
            about = f"[{zsh_text(o.text)}]"
            if len(o.names) == 1 or several:
                lines += [f"'{several}{name}{about}{action(o)}'" for name in o.names]
            else:
                lines.append(f"'({' '.join(o.names)})'{{{','.join(o.names)}}}'{about}{action(o)}'")
        for o in command.positionals:
            what = f"({' '.join(o.choices)})" if o.choices else "_files" if o.takes_file() else " "
            lines.append(f"'{'*' if o.repeated else ''}:{zsh_text(o.names[0])}:{what}'")
        return lines

    out = ["#compdef angiospline",
           "# zsh completion for angiospline; generated by scripts/make_reference.py from the program's own help.",
           "_angiospline() {", "  local context state state_descr line", "  typeset -A opt_args",
           "  _arguments -C \\"]
    out += [f"    {spec} \\" for spec in specs(app)]
    out += ["    '1:command:->command' '*::argument:->argument'", "  case $state in", "    command)",
            "      local -a commands=("]
    out += [f"        '{name}:{zsh_text(command.about)}'"
            for c, command in commands.items() for name in [c, *command.other_names]]
    out += ["      )", "      _describe command commands", "      ;;", "    argument)", "      case $words[1] in"]
    for c, command in commands.items():
        out += [f"        {'|'.join([c, *command.other_names])})", "          _arguments \\"]
        lines = specs(command)
        out += [f"            {spec} \\" for spec in lines[:-1]] + [f"            {lines[-1]}", "          ;;"]
    out += ["      esac", "      ;;", "  esac", "}", "_angiospline \"$@\""]
    return "\n".join(out) + "\n"


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    root = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else pathlib.Path(__file__).resolve().parent.parent
    version = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    app = help_of(program)
    # A command with another name is listed as "seed, build".
    commands = {names.split(", ")[0]: help_of(program, *names.split(", ")) for names, _ in app.subcommands}
    files = {"docs/reference.md": reference(app, commands), "cli/man/angiospline.1": man_page(app, commands, version),
             "cli/completions/angiospline.bash": bash_completion(app, commands),
             "cli/completions/_angiospline": zsh_completion(app, commands)}
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main()

#!/usr/bin/env python3
"""What the documentation points at exists: links, anchors, and the paths that pages and comments name.

Usage: check_links.py ROOT. Prints a line for each that leads nowhere and exits with 1 if there is one.

- Markdown links [text](target): a file or folder relative to the page, and the anchor in it. The network is not asked.
- `path/to/file.ext` and `path/to/module` in backticks, on a page: relative to the project, or to the page.
- `file.h` in backticks: the name of some file of the project.
- `test_x` and `bench_x` in backticks: a program that the tests or benches build, or a file of that name.
- path/to/file.h in a comment of a source file: relative to the project.
- A page's own lines are at most 120 columns wide, tables and code apart.
"""
import os
import re
import subprocess
import sys
import unicodedata

LINK = re.compile(r"(?<!\\)\[[^\]]*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")
SPAN = re.compile(r"`([^`]+)`")
SOURCE = r"(?:h|cpp|py|sh|js|html|cmake|md|txt|json|swc|tree|cff|yml)"
PATH = re.compile(r"[\w.-]+(?:/[\w.-]+)+\." + SOURCE + r"\b")
# Files that the program writes or reads share suffixes with ours; only these are surely ours.
NAME = re.compile(r"[a-z]\w*\.(?:h|cpp)")
MODULE = re.compile(r"\w+(?:/\w+)+")
PROGRAM = re.compile(r"\b(?:test|bench)_\w+")
TOP_FOLDERS = ("base/", "kernel/", "modeling/", "recovery/", "io/", "pipeline/", "cli/", "tests/", "benches/", "scripts/",
               "cmake/", "docs/", "samples/")
WIDTH = 120


def listed_files(root):
    """The files git knows or would take, or all of them outside of a repository."""
    git = subprocess.run(["git", "-C", root, "ls-files", "--cached", "--others", "--exclude-standard"],
                         capture_output=True, text=True, check=False)
    if git.returncode == 0 and git.stdout:
        return [f for f in git.stdout.split("\n") if f and os.path.exists(os.path.join(root, f))]
    found = []
    for folder, folders, files in os.walk(root):
        folders[:] = [f for f in folders if f not in (".git", "build", "out")]
        found += [os.path.relpath(os.path.join(folder, f), root) for f in files]
    return found


def without_code(text):
    """The text with the lines of code blocks emptied, so that line numbers stay."""
    lines, fenced = [], False
    for line in text.split("\n"):
        fence = line.lstrip().startswith("```")
        lines.append("" if fence or fenced else line)
        fenced = fenced != fence
    return lines


def anchor_of(heading):
    """The anchor that GitHub gives a heading."""
    heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    kept = [c for c in heading if c in " -_" or unicodedata.category(c)[0] in "LN"]
    return "".join(kept).replace(" ", "-")


def anchors(path):
    found, count = set(), {}
    with open(path, encoding="utf-8") as file:
        text = file.read()
    for line in without_code(text):
        heading = re.match(r"#{1,6}\s+(.*?)\s*#*$", line)
        if heading:
            anchor = anchor_of(heading.group(1))
            number = count.get(anchor, 0)
            count[anchor] = number + 1
            found.add(anchor if number == 0 else f"{anchor}-{number}")
    return found | set(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text))


class Checker:
    def __init__(self, root):
        self.root = root
        self.files = listed_files(root)
        self.names = {os.path.basename(f) for f in self.files}
        self.programs = {os.path.splitext(name)[0] for name in self.names} | self.programs_built()
        self.wrong = []
        self.checked = {"links": 0, "paths": 0, "names": 0, "comments": 0}

    def report(self, file, line, what):
        self.wrong.append(f"{file}:{line}: {what}")

    def programs_built(self):
        """Targets of the CMake lists: `test_x` for angiospline_test(x ...), `bench_x` by their own names."""
        built = set()
        for file in self.files:
            if os.path.basename(file) == "CMakeLists.txt":
                with open(os.path.join(self.root, file), encoding="utf-8") as lists:
                    text = lists.read()
                built |= {f"test_{name}" for name in re.findall(r"angiospline_test\((\w+)", text)}
                built |= set(PROGRAM.findall(text))
        return built

    def check_link(self, page, number, target):
        if re.match(r"[a-z]+:", target):
            return
        self.checked["links"] += 1
        path, _, anchor = target.partition("#")
        full = os.path.normpath(os.path.join(self.root, os.path.dirname(page), path)) if path else os.path.join(
            self.root, page)
        if not os.path.exists(full):
            self.report(page, number, f"the link {target} leads to no file")
        elif anchor and full.endswith(".md") and anchor not in anchors(full):
            self.report(page, number, f"the link {target} leads to no heading")

    def exists(self, page, path):
        return any(os.path.exists(os.path.join(self.root, base, path)) for base in ("", os.path.dirname(page)))

    def check_span(self, page, number, span):
        for path in PATH.findall(span):
            if path.startswith(TOP_FOLDERS):
                self.checked["paths"] += 1
                if not self.exists(page, path):
                    self.report(page, number, f"there is no {path}")
        if MODULE.fullmatch(span) and span.startswith(TOP_FOLDERS):
            self.checked["paths"] += 1
            if not any(self.exists(page, span + suffix) for suffix in ("", ".h", ".cpp")):
                self.report(page, number, f"there is no module or folder {span}")
        for program in PROGRAM.findall(span):
            self.checked["names"] += 1
            if program not in self.programs:
                self.report(page, number, f"nothing builds {program}")
        if NAME.fullmatch(span):
            self.checked["names"] += 1
            if span not in self.names:
                self.report(page, number, f"no file is called {span}")

    def check_page(self, page):
        with open(os.path.join(self.root, page), encoding="utf-8") as file:
            lines = without_code(file.read())
        for number, line in enumerate(lines, 1):
            for target in LINK.findall(line):
                self.check_link(page, number, target)
            for span in SPAN.findall(line):
                self.check_span(page, number, span)
            if len(line) > WIDTH and line[0] != "|" and not line.startswith("    ") and " " in line[:WIDTH].strip() and "](" not in line[WIDTH - 60:]:
                self.report(page, number, f"{len(line)} columns, {WIDTH} at most: scripts/wrap_markdown.py")

    def check_comments(self, source):
        """Paths in the comments of a source file: headers that moved leave such names behind."""
        with open(os.path.join(self.root, source), encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                comment = re.search(r"(?:^|\s)(?://|#(?!include))(.*)", line)
                if not comment:
                    continue
                for path in PATH.findall(comment.group(1)):
                    if path.startswith(TOP_FOLDERS) and not path.startswith("docs/html"):
                        self.checked["comments"] += 1
                        if not self.exists(source, path):
                            self.report(source, number, f"there is no {path}")

    def run(self):
        for file in sorted(self.files):
            if file.endswith(".md") and not file.startswith("tests/fuzz"):
                self.check_page(file)
            elif file.endswith((".h", ".cpp", ".py", ".sh", ".cmake", "CMakeLists.txt")):
                self.check_comments(file)
        return self.wrong


def main():
    checker = Checker(os.path.abspath(sys.argv[1]))
    wrong = checker.run()
    for line in wrong:
        print(line)
    print(", ".join(f"{count} {kind}" for kind, count in checker.checked.items()) + f" checked, {len(wrong)} wrong")
    if checker.checked["links"] == 0 or checker.checked["paths"] == 0:
        sys.exit("nothing was checked: is this the project's root?")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()

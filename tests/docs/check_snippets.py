#!/usr/bin/env python3
"""Runs the commands that a page shows, and compares what it says they print with what they print.

Usage: check_snippets.py --root ROOT --program ANGIOSPLINE PAGE [--least-run N]

Every block of a page marked `sh` runs, in the page's order, in one temporary folder that has the project's samples/;
`angiospline` there is the given program. A block that fails is an error. A block marked `text` right behind it is
what it prints: every line must come, in this order. In such a line `...` stands for anything, a line `...` for any
lines, and times (`0.4 s`) are not compared.

A block behind the comment <!-- not run: REASON --> does not run; it is counted and its reason printed. One behind
<!-- needs: PROGRAM --> runs where that program is installed, and is counted likewise where it is not.
A block marked `cpp` with a main function must be, character by character, a file of tests/package/client, which the
package's test compiles and runs.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile

NOT_RUN = re.compile(r"<!--\s*(not run|needs):\s*(.*?)\s*-->\s*$")
TIME = re.compile(r"\b\d+(?:\.\d+)?(?:e-?\d+)? ?m?s\b")


class Block:
    def __init__(self, language, line, reason):
        self.language, self.line, self.reason = language, line, reason
        self.text = ""
        self.follows = None  # the block right in front, only blank lines between


def reason_of(mark):
    """Why a marked block does not run here, or None."""
    if mark.group(1) == "not run":
        return mark.group(2)
    return None if shutil.which(mark.group(2)) else f"needs {mark.group(2)}, which is not installed"


def blocks(page_text):
    found, block, reason, between = [], None, None, ""
    for number, line in enumerate(page_text.split("\n"), 1):
        if block is None and line.startswith("```"):
            block = Block(line[3:].strip(), number, reason)
            block.follows = found[-1] if found and not between.strip() else None
            reason, between = None, ""
        elif block is not None and line.startswith("```"):
            found.append(block)
            block = None
        elif block is not None:
            block.text += line + "\n"
        else:
            between += line
            marked = NOT_RUN.search(line)
            if marked or line.strip():
                reason = reason_of(marked) if marked else None
    return found


def pattern_of(line):
    line = TIME.sub("\0", line.strip())
    parts = [re.escape(part) for part in line.split("...")]
    return re.compile(".*".join(parts).replace("\0", r"\d+(?:\.\d+)?(?:e-?\d+)? ?m?s") + "$")


def first_missing(expected, printed):
    """The first line of `expected` that `printed` does not have in this place, or None."""
    lines = [line.strip() for line in printed.split("\n") if line.strip()]
    at, may_skip = 0, False
    for line in expected.split("\n"):
        if not line.strip():
            continue
        if line.strip() == "...":
            may_skip = True
            continue
        pattern = pattern_of(line)
        while at < len(lines) and may_skip and not pattern.match(lines[at]):
            at += 1
        if at == len(lines) or not pattern.match(lines[at]):
            return line, lines[at] if at < len(lines) else "nothing more"
        at, may_skip = at + 1, False
    return None if may_skip or at == len(lines) else ("(no more lines)", lines[at])


def run_block(block, folder, program):
    environment = dict(os.environ, PATH=folder + "/.bin:" + os.environ["PATH"])
    os.makedirs(folder + "/.bin", exist_ok=True)
    link = folder + "/.bin/angiospline"
    if not os.path.lexists(link):
        os.symlink(os.path.abspath(program), link)
    return subprocess.run(["bash", "-euo", "pipefail", "-c", block.text], cwd=folder, env=environment, check=False,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def client_files(root):
    folder = os.path.join(root, "tests/package/client")
    texts = []
    for name in sorted(os.listdir(folder)):
        if name.endswith(".cpp"):
            with open(os.path.join(folder, name), encoding="utf-8") as file:
                texts.append(file.read())
    return texts


def check_page(root, program, page):
    with open(os.path.join(root, page), encoding="utf-8") as file:
        found = blocks(file.read())
    wrong, counts, reasons = [], {"run": 0, "outputs": 0, "programs": 0}, []
    folder = tempfile.mkdtemp(prefix="angiospline_snippets_")
    outputs = {}
    try:
        shutil.copytree(os.path.join(root, "samples"), os.path.join(folder, "samples"))
        for block in found:
            place = f"{page}:{block.line}"
            if block.language in ("sh", "bash"):
                if block.reason:
                    reasons.append(f"{place}: not run: {block.reason}")
                    continue
                result = run_block(block, folder, program)
                outputs[block] = result.stdout
                counts["run"] += 1
                if result.returncode != 0:
                    wrong.append(f"{place}: exit code {result.returncode}\n{block.text}{result.stdout}")
            elif block.language == "text" and block.follows in outputs:
                counts["outputs"] += 1
                missing = first_missing(block.text, outputs[block.follows])
                if missing:
                    wrong.append(f"{place}: the page has\n  {missing[0].strip()}\nand the command prints\n  {missing[1]}")
            elif block.language == "cpp" and "int main" in block.text:
                counts["programs"] += 1
                if block.text not in client_files(root):
                    wrong.append(f"{place}: no file of tests/package/client is this program")
    finally:
        shutil.rmtree(folder)
    return wrong, counts, reasons


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--root", required=True)
    parser.add_argument("--program", required=True)
    parser.add_argument("--least-run", type=int, default=1)
    parser.add_argument("page")
    arguments = parser.parse_args()
    wrong, counts, reasons = check_page(arguments.root, arguments.program, arguments.page)
    print("\n".join(wrong + reasons))
    print(f"{arguments.page}: {counts['run']} blocks run, {counts['outputs']} outputs and {counts['programs']} C++ programs "
          f"compared, {len(reasons)} not run, {len(wrong)} wrong")
    if counts["run"] < arguments.least_run:
        sys.exit(f"fewer than {arguments.least_run} blocks were run")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()

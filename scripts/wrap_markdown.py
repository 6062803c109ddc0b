#!/usr/bin/env python3
"""Wraps the paragraphs and list items of markdown files at 120 columns, in place.

Front matter, headings, tables, code blocks, block quotes, HTML and indented blocks stay as they are. Part of `make format`.
"""
import re
import sys
import textwrap

WIDTH = 120
LIST_ITEM = re.compile(r"^(\s*)([-*]|\d+[.)])(\s+)")
LOOKS_LIKE_ITEM = re.compile(r" (?=(?:[-+*]|\d+[.)])(?: |$)|[|#<>])")
LINK = re.compile(r"(\[[^\]]*\]\([^)]*\)|`[^`]*`)")


def wrapped(first_indent, next_indent, words):
    # A code span or a link is one word, however many blanks it has.
    text = LINK.sub(lambda m: m.group(0).replace(" ", "\0"), words)
    # Nor may a line begin with what markdown takes for the start of a list, a table, a heading or a quotation.
    text = LOOKS_LIKE_ITEM.sub("\0", text)
    lines = textwrap.wrap(text, WIDTH, initial_indent=first_indent, subsequent_indent=next_indent,
                          break_long_words=False, break_on_hyphens=False)
    return [line.replace("\0", " ") for line in lines]


def is_fixed(line):
    stripped = line.lstrip()
    return not stripped or stripped[0] in "|#><" or stripped.startswith(("---", "!["))


def wrap(text):
    out, paragraph = [], []
    fenced = in_comment = False

    def flush():
        if not paragraph:
            return
        item = LIST_ITEM.match(paragraph[0])
        if item:
            first, rest = item.group(0), " " * len(item.group(0))
            body = [paragraph[0][len(first):]] + paragraph[1:]
        else:
            first = rest = re.match(r"\s*", paragraph[0]).group(0)
            body = paragraph
        out.extend(wrapped(first, rest, " ".join(line.strip() for line in body)))
        paragraph.clear()

    lines = text.split("\n")
    front_matter = lines.index("---", 1) if lines[0] == "---" and "---" in lines[1:] else -1
    for k, line in enumerate(lines):
        if k <= front_matter:
            out.append(line)
            continue
        fence = line.lstrip().startswith("```")
        if fence or fenced or in_comment or "<!--" in line:
            flush()
            out.append(line)
            if fence:
                fenced = not fenced
            in_comment = not fenced and "-->" not in line and (in_comment or "<!--" in line)
            continue
        indented_code = not paragraph and line.startswith("    ") and not LIST_ITEM.match(line) and (
            k > 0 and (not lines[k - 1].strip() or (out and out[-1].startswith("    "))))
        if is_fixed(line) or indented_code:
            flush()
            out.append(line)
            continue
        if LIST_ITEM.match(line):
            flush()
        paragraph.append(line)
    flush()
    return "\n".join(out)


def main():
    for name in sys.argv[1:]:
        with open(name, encoding="utf-8") as file:
            before = file.read()
        after = wrap(before)
        if after != before:
            with open(name, "w", encoding="utf-8") as file:
                file.write(after)


if __name__ == "__main__":
    main()

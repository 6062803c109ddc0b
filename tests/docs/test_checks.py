#!/usr/bin/env python3
"""The checks of the documentation find what they look for: each is shown a page with that mistake."""
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import check_links  # noqa: E402
import check_snippets  # noqa: E402


class Project(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = self.folder.name
        self.write("docs/other.md", "# A heading, with *marks* (and more)\n\n## Twice\n\n## Twice\n")
        self.write("kernel/room/there.h", "// Nothing.\n")
        self.write("samples/tree.swc", "")
        self.write("tests/package/client/main.cpp", "int main() {}\n")
        self.write("program", "#!/bin/sh\necho \"figure $1 took 0.25 s\"\necho end\n")
        os.chmod(os.path.join(self.root, "program"), stat.S_IRWXU)

    def tearDown(self):
        self.folder.cleanup()

    def write(self, name, text):
        path = os.path.join(self.root, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)


class Links(Project):
    def wrong_on(self, page):
        self.write("docs/page.md", page)
        return check_links.Checker(self.root).run()

    def test_what_leads_somewhere_is_accepted(self):
        self.assertEqual(self.wrong_on("[a](other.md) [b](other.md#a-heading-with-marks-and-more) [c](#own)\n\n# Own\n"
                                       "[d](other.md#twice-1) `kernel/room/there.h` `kernel/room/there` `there.h` [e](https://x.y/z)\n"), [])

    def test_a_missing_file_a_missing_heading_and_a_stale_path_are_found(self):
        for mistake in ("[a](gone.md)", "[a](other.md#no-such)", "[a](other.md#twice-2)", "`kernel/there.h`", "`kernel/gone`", "`gone.h`",
                        "`test_gone`", "word " * 30):
            self.assertEqual(len(self.wrong_on(mistake + "\n")), 1, mistake)

    def test_code_blocks_are_not_looked_at(self):
        self.assertEqual(self.wrong_on("```\n[a](gone.md) `gone.h`\n```\n"), [])

    def test_a_stale_path_in_a_comment_is_found(self):
        self.write("kernel/room/there.h", "// See kernel/gone.h, kernel/room/there.h.\n")
        self.assertEqual(self.wrong_on("\n"), ["kernel/room/there.h:1: there is no kernel/gone.h"])


class Snippets(Project):
    def check(self, page):
        self.write("docs/page.md", page)
        return check_snippets.check_page(self.root, os.path.join(self.root, "program"), "docs/page.md")

    def test_a_block_runs_and_its_output_is_compared(self):
        wrong, counts, reasons = self.check(
            "```sh\ncat samples/tree.swc\nangiospline 7\n```\n\n```text\nfigure 7 took 0.31 s\nend\n```\n")
        self.assertEqual((wrong, reasons), ([], []))
        self.assertEqual((counts["run"], counts["outputs"]), (1, 1))

    def test_blocks_share_a_folder(self):
        self.assertEqual(self.check("```sh\ntouch a\n```\nThen\n```sh\nls a\n```\n")[0], [])

    def test_a_command_that_fails_is_found(self):
        self.assertEqual(len(self.check("```sh\nfalse\ntrue\n```\n")[0]), 1)

    def test_another_output_is_found(self):
        for output in ("figure 8 took 0.31 s\nend", "end", "figure 7 took 0.31 s", "figure 7 took 0.31 s\nend\nmore"):
            self.assertEqual(len(self.check(f"```sh\nangiospline 7\n```\n```text\n{output}\n```\n")[0]), 1, output)

    def test_dots_stand_for_anything(self):
        for output in ("...\nend", "figure ...\n...", "fig...took...\nend"):
            self.assertEqual(self.check(f"```sh\nangiospline 7\n```\n```text\n{output}\n```\n")[0], [], output)

    def test_a_marked_block_is_counted_and_not_run(self):
        wrong, counts, reasons = self.check("<!-- not run: needs a reason -->\n```sh\nfalse\n```\n")
        self.assertEqual((wrong, counts["run"], len(reasons)), ([], 0, 1))

    def test_a_block_that_needs_a_program_runs_where_it_is(self):
        wrong, counts, reasons = self.check("<!-- needs: bash -->\n```sh\nfalse\n```\n")
        self.assertEqual((len(wrong), counts["run"], len(reasons)), (1, 1, 0))
        wrong, counts, reasons = self.check("<!-- needs: no_such_program -->\n```sh\nfalse\n```\n")
        self.assertEqual((len(wrong), counts["run"], len(reasons)), (0, 0, 1))

    def test_a_mark_serves_one_block(self):
        self.assertEqual(len(self.check("<!-- not run: why -->\n```sh\nfalse\n```\n\n```sh\nfalse\n```\n")[0]), 1)

    def test_a_program_that_nobody_compiles_is_found(self):
        self.assertEqual(self.check("```cpp\nint main() {}\n```\n")[0], [])
        self.assertEqual(len(self.check("```cpp\nint main() { }\n```\n")[0]), 1)


@unittest.skipUnless(shutil.which("c++"), "no compiler")
class Examples(Project):
    def exit_code(self, page):
        self.write("docs/page.md", page)
        check = os.path.join(os.path.dirname(os.path.abspath(__file__)), "check_examples.py")
        return subprocess.run([sys.executable, check, "--root", self.root, "--compiler", "c++", "docs/page.md"],
                              stdout=subprocess.DEVNULL, check=False).returncode

    def test_an_example_sees_its_own_header_and_the_projects(self):
        self.assertEqual(self.exit_code("<!-- file: room/a.h -->\n```cpp\nint f(int x);\n```\nand\n"
                                        "<!-- file: room/a.cpp -->\n```cpp\n#include \"room/a.h\"\n"
                                        "#include \"kernel/room/there.h\"\nint f(int x) { return x; }\n```\n"), 0)

    def test_an_example_that_does_not_compile_or_is_not_there_is_found(self):
        self.assertNotEqual(self.exit_code("<!-- file: a.cpp -->\n```cpp\nint f() { return g(); }\n```\n"), 0)
        self.assertNotEqual(self.exit_code("Nothing.\n"), 0)


if __name__ == "__main__":
    unittest.main()

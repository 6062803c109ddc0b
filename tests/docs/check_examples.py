#!/usr/bin/env python3
"""The worked examples of docs/extending.md compile against the present headers.

Usage: check_examples.py --root ROOT --compiler CXX [--least N] PAGE
A block behind <!-- file: path --> is that file. All are written to a temporary folder, and every .cpp among them is
compiled with warnings as errors, without making an object.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile

FILE = re.compile(r"<!--\s*file:\s*(\S+)\s*-->\s*\n```cpp\n(.*?)```", re.DOTALL)
FLAGS = ["-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-Werror",
         "-isystem", "/usr/include/eigen3"]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--root", required=True)
    parser.add_argument("--compiler", required=True)
    parser.add_argument("--least", type=int, default=1)
    parser.add_argument("page")
    arguments = parser.parse_args()
    with open(os.path.join(arguments.root, arguments.page), encoding="utf-8") as file:
        files = FILE.findall(file.read())
    sources = [path for path, _ in files if path.endswith(".cpp")]
    wrong = [f"{path} exists: the example must not be a file of the project" for path, _ in files
             if os.path.exists(os.path.join(arguments.root, path))]
    with tempfile.TemporaryDirectory(prefix="angiospline_examples_") as folder:
        for path, text in files:
            os.makedirs(os.path.join(folder, os.path.dirname(path)), exist_ok=True)
            with open(os.path.join(folder, path), "w", encoding="utf-8") as file:
                file.write(text)
        for source in sources:
            done = subprocess.run([arguments.compiler, *FLAGS, "-I", folder, "-I", arguments.root,
                                   os.path.join(folder, source)], capture_output=True, text=True, check=False)
            if done.returncode != 0:
                wrong.append(f"{source}:\n{done.stderr}")
    print("\n".join(wrong))
    print(f"{arguments.page}: {len(sources)} examples compiled, {len(wrong)} wrong")
    sys.exit(1 if wrong or len(sources) < arguments.least else 0)


if __name__ == "__main__":
    main()

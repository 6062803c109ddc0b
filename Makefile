# make alone says what there is.
SHELL := /bin/bash
JOBS ?= $(shell nproc)
BUILD := build/release

.PHONY: help install build test judges demo sanitize odr clang bench deb format tidy docs gallery clean

help:
	@echo "Angiospline: vessels to CAD."
	@echo
	@echo "  make demo      install what is missing, build, run the main job on the built-in sample"
	@echo "  make test      install, build, run all tests"
	@echo "  make build     install, build: the program is $(BUILD)/cli/angiospline"
	@echo "  make judges    install gmsh, FreeCAD, Netgen, a browser ... and run all tests with them"
	@echo "  make sanitize  all tests under the address and undefined-behaviour sanitizers"
	@echo "  make odr       links with an error where one name is defined in two ways"
	@echo "  make clang     build and test with clang 14"
	@echo "  make bench     build and run the benchmarks"
	@echo "  make deb       build the Debian packages: $(BUILD)/packages/"
	@echo "  make format    clang-format every source file; make tidy: clang-tidy"
	@echo "  make docs      the API reference: build/docs/html/index.html"
	@echo "  make gallery   the pictures of docs/gallery.md, from the program's output"
	@echo "  make clean     remove build/ and out/"

install:
	@scripts/install_packages.sh

build: install
	@scripts/build.sh release

test: build
	@scripts/run_tests.sh release

judges: install
	@scripts/install_judges.sh
	@$(MAKE) --no-print-directory test

demo: install
	@scripts/build.sh release angiospline
	@scripts/demo.sh $(BUILD)/cli/angiospline out/demo

sanitize: install
	@scripts/build.sh sanitize
	@scripts/run_tests.sh sanitize

odr: install
	@scripts/build.sh odr angiospline

clang: install
	@scripts/install_packages.sh scripts/packages-dev.txt
	@scripts/build.sh clang
	@scripts/run_tests.sh clang

bench: install
	@scripts/bench.sh

deb: install
	@scripts/build.sh release angiospline
	@cd $(BUILD) && cpack -G DEB

format:
	@scripts/install_packages.sh scripts/packages-dev.txt
	@git ls-files '*.h' '*.cpp' | xargs clang-format-14 -i
	@git ls-files '*.md' | xargs /usr/bin/python3 scripts/wrap_markdown.py

tidy: build
	@scripts/install_packages.sh scripts/packages-dev.txt
	@git ls-files '*.cpp' | grep -v '^tests/\|^benches/' | xargs -P $(JOBS) -n 4 clang-tidy-14 --quiet -p $(BUILD)

docs:
	@scripts/install_packages.sh <(echo doxygen)
	@scripts/make_api_docs.sh build/docs

gallery: build
	@scripts/install_packages.sh <(printf '%s\n' python3-numpy python3-pil)
	@/usr/bin/python3 scripts/make_gallery.py $(BUILD)/cli/angiospline docs/images

clean:
	rm -rf build out

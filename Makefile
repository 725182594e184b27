# The commands of the project; `make help` lists them.
SHELL := /bin/bash
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

venv := .venv
transom := $(venv)/bin/transom
cmake_files := CMakeLists.txt CMakePresets.json $(wildcard tools/cmake/*.cmake)

.PHONY: help
help: ## this list
	@echo "Transom: interactive daylighting, checked against ground truth."
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{ printf "%-20s %s\n", $$1, $$2 }'

.PHONY: setup
setup: $(venv)/.project engine ## install what is missing, build the engine; leaves the command at .venv/bin/transom

.PHONY: report
report: setup ## render the scenes, compare them with the references, write build/report/index.html
	@status=0; $(transom) report || status=$$?; \
	if [ -f build/report/index.html ]; then echo "Report: $(CURDIR)/build/report/index.html"; fi; \
	if [ $$status = 3 ]; then echo "Some verdicts are inconclusive: the page says which, and what they need."; status=0; fi; \
	exit $$status

.PHONY: test
test: setup ## layout, types and tests, but the slow ones: about ten minutes
	@tools/check.sh quick

.PHONY: test-all
test-all: setup ## everything that `make test` does, and slow tests, clang-tidy, sanitizers, the wheel: about an hour
	@tools/check.sh all

.PHONY: check
check: setup ## has accuracy changed? the quick suite against references and our own baseline: some minutes
	@$(transom) check

.PHONY: references
references: setup ## render the references that `make report` needs into reference/store: hours; resumes when stopped
	$(transom) run references

.PHONY: doctor
doctor: setup ## say what the set-up looks like, and what to do about anything that is wrong
	@$(transom) doctor

.PHONY: format
format: $(venv)/.requirements ## lay out all Python and C++ code as ruff and clang-format have it
	@$(venv)/bin/ruff format
	@$(venv)/bin/ruff check --fix
	@tools/check.sh format

.PHONY: lock
lock: ## resolve requirements.in into requirements.lock again
	@tools/lock.sh

.PHONY: clean
clean: ## remove everything that was built, but the virtual environment
	rm -rf build dist .mypy_cache .pytest_cache .ruff_cache
	rm -f harness/transom/_engine*.so harness/transom/_engine.pyi

# ---- Set-up in steps, each done again only when what it depends on has changed ------------------------------------

build/.system: tools/setup.sh
	@tools/setup.sh
	@mkdir -p build && touch $@

$(venv)/.requirements: requirements.lock | build/.system
	@python=$$(tools/setup.sh --python) && { [ -x $(venv)/bin/python ] || "$$python" -m venv $(venv); }
	@echo "Installing the Python packages of requirements.lock"
	@$(venv)/bin/python -m pip install --quiet --require-hashes -r requirements.lock
	@touch $@

$(venv)/.project: pyproject.toml $(venv)/.requirements
	@$(venv)/bin/python -m pip install --quiet --no-deps --no-build-isolation --no-index --editable .
	@touch $@

build/release/build.ninja: $(cmake_files) $(venv)/.requirements
	@mkdir -p build
	@echo "Configuring the engine"
	@cmake --preset release >build/configure.log 2>&1 || { cat build/configure.log; exit 1; }
	@touch $@

.PHONY: engine
engine: build/release/build.ninja
	@cmake --build --preset release

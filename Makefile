# eutree: `make demo` and `make test` install everything they need into .venv, then run.
#
#   make demo      demonstrations, training, evaluation, compression, export and a report
#   make test      the tests (5:40 in 4 processes on two quiet cores, kernels compiled before)
#   make test-all  the tests with the slow ones
#   make check     format, lint, types, import contracts, documentation
#   make docs      the documentation, into docs/_build/html
#   make bench     the benchmarks
#   make table-smoke  a small part of the table again, beside what is stored (ten minutes)
#   make pictures  the pictures of trees, pages and the recorder in docs/images (needs chromium)
#   make results   renew the figures in docs/results that are older than their sources (hours)
#   make lock      the lock files in requirements/ (maintainers; needs uv; ARGS=--upgrade)
#   make changelog fold changelog.d/ into CHANGELOG.md (before a release; RELEASE=0.2.0 heads it)
#   make clean     remove what the above have made
#
# Options: PYTHON=python3.13 (the interpreter), VENV=.venv-3.13 (where to install), UV= (use pip
# although uv is there), JOBS=4 (test processes), ARGS="..." (more arguments for the command),
# RUN_LOCK=, TEST_LOCK= (other lock files).

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
MAKEFLAGS += --no-print-directory
# The tests start hundreds of interpreters; compiling every module anew costs each half a second.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
VENV ?= .venv
# Tests wait for browsers and other processes a third of their time, so four share two cores.
CORES := $(shell nproc 2>/dev/null || sysctl -n hw.ncpu 2>/dev/null || echo 2)
JOBS ?= $(shell expr $(CORES) + 2)
ARGS ?=
RUN_LOCK ?= requirements/run.txt
TEST_LOCK ?= requirements/test.txt
UV ?= $(shell command -v uv 2>/dev/null)
PY := $(VENV)/bin/python

# Downloads of interpreters are refused: they hang for long where there is no network.
ifneq ($(strip $(UV)),)
  MKVENV = UV_PYTHON_DOWNLOADS=never "$(UV)" venv -q --clear --python "$(PYTHON)" $(VENV)
  INSTALL = UV_PYTHON_DOWNLOADS=never "$(UV)" pip install -q --python $(VENV)
else
  MKVENV = "$(PYTHON)" -c 'import ensurepip' 2>/dev/null || { echo 'error: $(PYTHON) cannot create virtual environments. On Debian or Ubuntu: apt-get install python3-venv. Without root, if pip is there: $(PYTHON) -m pip install --require-hashes --target .tools -r requirements/uv.txt, then: make UV=.tools/bin/uv $(GOAL)' >&2; exit 1; }; "$(PYTHON)" -m venv --clear $(VENV)
  # An environment that uv has made has no pip; ensurepip brings its own copy along.
  INSTALL = { "$(PY)" -c 'import pip' 2>/dev/null || "$(PY)" -m ensurepip >/dev/null; } && $(PY) -m pip install -q --disable-pip-version-check --no-input
endif

# A second make waits for the first. The lock outlives a killed make until its children have ended.
FLOCK := $(shell command -v flock 2>/dev/null)
LOCKED = $(if $(FLOCK),"$(FLOCK)" .venv.lock) $(MAKE) -s

.PHONY: demo test test-all check docs bench table-smoke pictures results lock changelog clean install-run install-test

demo: install-run
	$(PY) -m eutree demo $(ARGS)

test: install-test
	$(PY) -m pytest -q -rs -p no:benchmark -n $(JOBS) --dist worksteal -m "not slow" $(ARGS)

test-all: install-test
	$(PY) -m pytest -q -rs -p no:benchmark -n $(JOBS) --dist worksteal $(ARGS)

# Everything here can fail but the ages of figures, which are listed.
check: install-test
	$(PY) -m ruff format --check .
	$(PY) -m ruff check .
	$(PY) -m mypy
	$(VENV)/bin/lint-imports --no-cache
	$(PY) docs/results/provenance.py
	$(MAKE) docs

docs: install-test
	$(PY) -m sphinx -q -E -W --keep-going -n -j auto -b html docs docs/_build/html
	@echo "documentation: docs/_build/html/index.html"

bench: install-test
	$(PY) -m pytest -q -p no:xdist benchmarks $(ARGS)

table-smoke: install-test
	$(PY) -m benchmarks.releases $(ARGS)

results: install-test
	PATH="$$PWD/$(VENV)/bin:$$PATH" $(PY) docs/results/provenance.py --renew $(ARGS)

# The runs behind the pictures stay in a temporary folder.
pictures: install-test
	folder=$$(mktemp -d); \
	$(PY) -m eutree record eutree/Evasion2-v0 --expert gate --episodes 15 --seed 0 --out $$folder/demos; \
	$(PY) -m eutree fit $$folder/demos --out $$folder/expert.json; \
	$(PY) -m eutree export $$folder/expert.json --format svg --out docs/images/expert-tree.svg; \
	rm -r $$folder
	$(PY) docs/images/make_pictures.py
	$(PY) docs/pictures/make_tutorial.py
	$(PY) docs/images/make_recorder_animation.py

install-run install-test: install-%:
	@[ "$$(cat $(VENV)/.made 2>/dev/null)" = "$$PWD" ] || rm -f $(VENV)/.made $(VENV)/.run $(VENV)/.test
	@$(LOCKED) GOAL='$(firstword $(MAKECMDGOALS) demo)' $(VENV)/.$*

# The stamps below appear only after success; .made also says which folder it belongs to, because
# a virtual environment cannot be moved.
$(VENV)/.made:
	@command -v "$(PYTHON)" >/dev/null || { echo 'error: there is no $(PYTHON); Python 3.11 or newer is needed' >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"error: Python 3.11 or newer is needed, found {v[0]}.{v[1]}; try: make PYTHON=python3.12 $(GOAL)")'
	@$(MKVENV)
	@pwd > $@

$(VENV)/.run: $(RUN_LOCK) requirements/build.txt pyproject.toml | $(VENV)/.made
	@echo "installing eutree into $(VENV) (about a minute the first time)"
	@$(INSTALL) --require-hashes -r $(RUN_LOCK)
	@$(INSTALL) --require-hashes -r requirements/build.txt
	@$(INSTALL) --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/.test: $(TEST_LOCK) $(VENV)/.run
	@echo "installing the test tools into $(VENV) (about a minute the first time)"
	@$(INSTALL) --require-hashes -r $(TEST_LOCK)
	@touch $@

# run: what `make demo` needs. test: all extras and tools. build: the build back end. oldest: the
# oldest declared versions of what eutree depends on, with today's tools. uv: the way round a
# missing python3-venv. sumo: examples/traffic_light. The guard at the end: no lock names a host, an
# index or a local path.
LOCK = $(UV) pip compile -q --universal --python-version 3.11 --generate-hashes --no-header --no-annotate $(ARGS)
TOOLS = --group test --group bench --group check --group docs
OLDEST = --extra record --extra plot --extra sklearn --extra minari --extra onnx --extra tensorboard

lock:
	@[ -n "$(UV)" ] || { echo 'error: make lock needs uv on PATH' >&2; exit 1; }
	$(LOCK) pyproject.toml --extra record --extra plot -o requirements/run.txt
	$(LOCK) pyproject.toml --extra all --extra cluster $(TOOLS) -c requirements/run.txt -o requirements/test.txt
	$(LOCK) pyproject.toml --extra sumo -c requirements/run.txt -o requirements/sumo.txt
	printf 'hatchling\neditables\n' | $(LOCK) - -o requirements/build.txt
	printf 'uv\n' | $(LOCK) - -o requirements/uv.txt
	$(LOCK) pyproject.toml $(OLDEST) --resolution lowest-direct -o $(VENV).oldest.txt
	$(LOCK) pyproject.toml $(OLDEST) --group test --group bench -c $(VENV).oldest.txt -o requirements/oldest.txt
	rm $(VENV).oldest.txt
	! grep -nE '://|^-' requirements/*.txt

# Fold the fragments into the changelog; part of a release. RELEASE=0.2.0 puts all that was not
# released under that heading, with the day.
changelog:
	@ls changelog.d/*.md >/dev/null 2>&1 || { echo 'error: there is nothing in changelog.d to fold' >&2; exit 1; }
	{ sed '/^## Unreleased/q' CHANGELOG.md; \
	  [ -z '$(RELEASE)' ] || printf '\n## %s (%s)\n' '$(RELEASE)' "$$(date -u +%F)"; \
	  echo; cat changelog.d/*.md; sed '1,/^## Unreleased/d' CHANGELOG.md; } > CHANGELOG.md.new
	mv CHANGELOG.md.new CHANGELOG.md
	rm changelog.d/*.md

clean:
	rm -rf $(VENV) .venv.lock .mypy_cache .ruff_cache .hypothesis docs/_build

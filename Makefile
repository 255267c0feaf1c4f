# `make run` and `make test` set up all they need: make and Python 3.11+ with venv are enough.
# Another interpreter: make test PYTHON=python3.12

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
# pip is there, and the Python is new enough.
USABLE = $(BIN)/python -c 'import sys, pip; sys.exit(sys.version_info < (3, 11))'
INPUTS := pyproject.toml constraints.txt
# A process a core, each with one thread; four at most, as each takes a gigabyte or so.
PYTEST := OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist worksteal

# Compiled modules are kept: without them each process compiles the whole tree, which doubles the tests' time.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
# The stamps below share one environment: two pips at once would spoil it.
.NOTPARALLEL:
.DELETE_ON_ERROR:
.PHONY: help run test test-slow test-all fuzz lint docs bench clean .make-venv

help:
	@echo "make run       calibrate the xr701 from its measurements; results in out/"
	@echo "make test      the tests, without the slow ones; some files: FILES='tests/test_ci.py ...'"
	@echo "make test-slow the slow ones alone"
	@echo "make test-all  all tests"
	@echo "make fuzz      mutated files through every reader, and kills: FUZZ_COUNT=100000 FUZZ_SECONDS=600 FUZZ_SEED=... FUZZ_KILLS=100"
	@echo "make lint      ruff, mypy and the import contract"
	@echo "make docs      the site, in build/site/index.html; a warning is an error"
	@echo "make bench     benchmarks"
	@echo "make clean     remove the environment and caches (results in out/ stay)"

run: $(VENV)/.installed-run
	$(BIN)/stiffarm run xr701 --out out

test: $(VENV)/.installed-test
	$(PYTEST) -m "not slow" $(FILES)

test-slow: $(VENV)/.installed-test
	$(PYTEST) -m slow

test-all: $(VENV)/.installed-test
	$(PYTEST)

fuzz: $(VENV)/.installed-test
	$(BIN)/python -m tests.fuzz $(if $(FUZZ_COUNT),--count $(FUZZ_COUNT)) $(if $(FUZZ_SECONDS),--seconds $(FUZZ_SECONDS)) \
	  $(if $(FUZZ_SEED),--seed $(FUZZ_SEED)) $(if $(FUZZ_KILLS),--kills $(FUZZ_KILLS))

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -q -n -W --keep-going -b html docs build/site
	@echo "open build/site/index.html"

bench: $(VENV)/.installed-test
	for file in benchmarks/*.py benchmarks/*/*.py; do echo "== $$file"; $(BIN)/python $$file || exit 1; done

# A stamp is older than its inputs when they change, and only then is anything installed again.
$(VENV)/.installed-run: $(VENV)/.made $(INPUTS)
	@echo "Installing stiffarm into $(VENV) ..."
	@$(PIP_INSTALL) -e .
	@touch $@

$(VENV)/.installed-test: $(VENV)/.made $(INPUTS)
	@echo "Installing stiffarm and what its tests need into $(VENV) ..."
	@$(PIP_INSTALL) -e '.[test,oracle]'
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.made $(INPUTS)
	@echo "Installing stiffarm and the development tools into $(VENV) ..."
	@$(PIP_INSTALL) -e '.[test,dev]'
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.made $(INPUTS)
	@echo "Installing stiffarm and what its site needs into $(VENV) ..."
	@$(PIP_INSTALL) -e '.[docs]'
	@touch $@

# Not the folder itself: a venv that failed half-way leaves it behind. One that works already is kept.
$(VENV)/.made:
	@$(USABLE) 2>/dev/null || $(MAKE) --no-print-directory .make-venv
	@$(USABLE) || { echo "make: $(VENV) is broken or too old. Remove it and try again: make clean" >&2; exit 1; }
	@touch $@

.make-venv:
	@command -v $(PYTHON) >/dev/null || { \
	  echo "make: $(PYTHON) not found. Install Python 3.11 or newer, or name one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "make: $(PYTHON) is $$($(PYTHON) -V 2>&1); stiffarm needs Python 3.11 or newer." >&2; \
	  echo "      Name a newer one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { \
	  echo "make: $(PYTHON) cannot make a virtual environment (on Debian: apt install python3-venv)." >&2; exit 1; }

clean:
	rm -rf docs/reference/commands docs/reference/keys docs/reference/python docs/gallery/scripts
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Needs python3 (3.11 or newer, with venv) and make; everything else goes into .venv.
#   make demo        the main job on the shipped recordings
#   make test        lint, types, import contracts, tests: at most five minutes on two cores
#   make test-all    what make test leaves out: processes, browsers, notebooks, documents, FMUs, long simulations;
#                    and the property tests once more, with more examples; keeps what it compiles in /tmp
#   make bench       the benchmark table
#   make docs        the guide and the reference, in build/docs
#   make fuzz        every loader on damaged files, counted in docs/fuzzing.md
#   make clean       remove .venv and caches
# Before a change is called done: make test and make test-all.
# Another interpreter: make demo PYTHON=python3.12. Options for pytest: make test PYTEST_ARGS="-k rig".

PYTHON ?= python3
PYTEST_ARGS ?= -n auto --dist worksteal
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# uv finds what belongs together and installs it in a quarter of pip's time; where it cannot be had, or reaches no index,
# pip serves.
UV := UV_HTTP_RETRIES=0 $(BIN)/python -m uv pip install --quiet --python $(BIN)/python
install = $(UV) --editable '.$(1)' 2>/dev/null || $(PIP) install --quiet --no-compile --editable '.$(1)'
# pip compiles what it installs on one core, tests of packages too, and what is not run from there; packages bring files
# of other Pythons along, which do not compile.
UNUSED := site-packages/(.*/tests|pip|uv|setuptools|pkg_resources|mypy|mypyc)/
COMPILE := $(BIN)/python -m compileall -q -j 0 -x '$(UNUSED)' $(VENV)/lib >/dev/null || true

.PHONY: demo test lint test-all bench docs fuzz clean

demo: $(VENV)/.installed
	$(BIN)/savgs-ident demo

test: lint
	$(BIN)/python -m pytest $(PYTEST_ARGS)

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers 2 savgs_ident
	$(BIN)/lint-imports

# The peers in the benchmarks are tested, too.
test-all: $(VENV)/.installed-test-all
	HYPOTHESIS_PROFILE=thorough $(BIN)/python -m pytest -m "slow or hypothesis" $(PYTEST_ARGS)

bench: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks

# Pages of modules that are gone would be read again.
docs: $(VENV)/.installed-docs
	rm -rf docs/reference
	$(BIN)/python -m sphinx -W --keep-going -q -E docs build/docs
	@echo "build/docs/index.html"

fuzz: $(VENV)/.installed-test
	$(BIN)/python -m fuzz --count 2000 --seed 1 --jobs 2 --out docs/fuzzing.md

clean:
	rm -rf docs/reference $(VENV) .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis build dist

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; name one with: make PYTHON=/path/to/python3.12"; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' || \
		{ echo "this Python has no venv; on Debian or Ubuntu: apt-get install python3-venv"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	@$(PIP) install --quiet --retries 0 uv 2>/dev/null || true

# Installed as a link to this folder: a change of the code needs no new installation, one of pyproject.toml does.
$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(call install,)
	@$(COMPILE)
	@touch $@

$(VENV)/.installed-test: pyproject.toml | $(BIN)/python
	$(call install,[test])
	@$(COMPILE)
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-test-all: pyproject.toml | $(BIN)/python
	$(call install,[test-all])
	@$(COMPILE)
	@touch $@ $(VENV)/.installed $(VENV)/.installed-test $(VENV)/.installed-bench $(VENV)/.installed-docs

$(VENV)/.installed-docs: pyproject.toml | $(BIN)/python
	$(call install,[docs])
	@$(COMPILE)
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-bench: pyproject.toml | $(BIN)/python
	$(call install,[bench])
	@$(COMPILE)
	@touch $@ $(VENV)/.installed

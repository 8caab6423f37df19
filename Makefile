# make fly: set up and fly the square.  make test: set up and run the quick tests.  make test-all: every test.  make check: what CI runs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# what flying needs, and what checks and tests need besides
FLY_READY := $(VENV)/.fly-ready
READY := $(VENV)/.test-ready
# bytecode is written for what is imported, when it is first imported: half of the time to install, a fifth less room
export PYTHONDONTWRITEBYTECODE :=
INSTALL := $(BIN)/python -m pip install -q --no-compile --disable-pip-version-check -e
# test processes side by side: twice the cores, because flights in real time wait most of theirs
WORKERS ?= 4
# the quick tests, and where they are: other folders are not imported
QUICK := -m "(unit or protocol or flight or parity or smoke) and not long" \
	tests/parity tests/processes/test_gcs_fly.py tests/protocol tests/scenarios tests/unit
# they never wait
CORES := $(shell getconf _NPROCESSORS_ONLN)
# files in order: those of firmware, interop and processes, which take longest, come first
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder
.DEFAULT_GOAL := help

.PHONY: help setup fly test test-all nightly oldest stress check static lint types imports generated generate docs bench fuzz fuzz-firmware firmware-check mutation clean

help: ## Show the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 16

setup: $(READY) ## Make the virtual environment with the developers' tools; compile kernels and tests

define MAKE_VENV
	@test -x $(BIN)/python || $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "flightstack needs Python 3.11 or newer: run make with PYTHON=/path/to/python3.11" >&2; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
endef

$(FLY_READY): pyproject.toml
	$(MAKE_VENV)
	@echo "Installing flightstack into $(VENV) ..."
	@$(INSTALL) .
	@touch $@

# after that of flying, if both are asked for
$(READY): pyproject.toml | $(if $(filter fly,$(MAKECMDGOALS)),$(FLY_READY))
	$(MAKE_VENV)
	@echo "Installing flightstack and the developers' tools into $(VENV) ..."
	@$(INSTALL) '.[dev]'
	@touch $(FLY_READY)
	@{ $(BIN)/sim-bridge open-loop --rotors 214,214,214,214 --seconds 0.01 --json >/dev/null && \
		{ $(BIN)/python -m pytest --collect-only -qq >/dev/null || true; }; } & \
		$(BIN)/flightstack --check && wait $$!  # bytecode of tests, and of most of what they import
	@$(BIN)/python -m tests.support.warm_world  # else the first tests compile its kernels side by side, each anew
	@touch $@

fly: $(FLY_READY) ## Fly missions/square.plan: simulator, flight stack and ground station as three processes
	@$(BIN)/gcs fly missions/square.plan

test: $(READY) ## Run the tests that a developer runs all day: eleven in twelve of unit, protocol, flights, C against Python; one real flight
	@$(PYTEST) -n $(CORES) $(QUICK)

test-all: $(READY) ## Run every test
	@$(PYTEST) --durations 15

nightly: $(READY) ## Run every test with all its samples, seeds and combinations, and those of oldest
	@NIGHTLY=1 $(PYTEST) --durations 25
	@$(MAKE) --no-print-directory oldest

oldest: ## Run the quick tests with the oldest libraries that pyproject.toml admits, in an environment of their own
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info >= (3, 13))' || \
		{ echo "the oldest libraries have no packages for Python 3.13: run make with PYTHON=/path/to/python3.11" >&2; exit 1; }
	@mkdir -p build
	@$(PYTHON) -m tools.oldest_versions > build/oldest.txt
	@PIP_CONSTRAINT=$(CURDIR)/build/oldest.txt $(MAKE) --no-print-directory VENV=.venv-oldest test

stress: $(READY) ## Run every test beside a program that keeps each core busy
	@$(BIN)/python tools/beside_load.py $(PYTEST)

check: static test-all ## Everything that CI checks

static: $(READY) ## Check everything that needs no test: style, types, imports, generated files, documentation
	@$(MAKE) --no-print-directory -j 2 --output-sync lint types imports generated docs

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

imports: $(READY)
	$(BIN)/lint-imports

generated: $(READY)
	$(BIN)/python -m tools.generate_dialect --check
	$(BIN)/python -m tools.derive_estimator --check
	$(BIN)/python -m tools.generate_params --check
	$(BIN)/python -m tools.generate_cli --check
	$(BIN)/python -m tools.generate_tables --check
	$(BIN)/python -m firmware.tools.generate_codec --check
	$(BIN)/python -m firmware.tools.generate_core --check

generate: $(READY) ## Regenerate files made from others
	$(BIN)/python -m tools.generate_dialect
	$(BIN)/python -m tools.derive_estimator
	$(BIN)/python -m tools.generate_params
	$(BIN)/python -m tools.generate_cli
	$(BIN)/python -m tools.generate_tables
	$(BIN)/python -m firmware.tools.generate_codec
	$(BIN)/python -m firmware.tools.generate_core

docs: $(READY) ## Build the documentation as a site into site/
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

bench: $(READY) ## Print speeds beside their floors
	@$(BIN)/python -m benchmarks

SECONDS ?= 60
fuzz: $(READY) ## Coverage-guided fuzz of every link, SECONDS=60 each; needs atheris
	@$(BIN)/python -m tests.fuzz.guided --seconds $(SECONDS)

fuzz-firmware: $(READY) ## Coverage-guided fuzz of the firmware's parser and codec, SECONDS=60; needs clang
	@$(BIN)/python -m tests.firmware.codec_fuzz $(SECONDS)

firmware-check: $(READY) ## Check the firmware alone: compilers, cppcheck, MISRA, parity, emulation
	@$(BIN)/python -m pytest tests/firmware tests/parity tests/mutation

MUTANTS ?= 0
mutation: $(READY) ## Plant faults into core, codec and application and count those that tests find: an hour or two; goes on where it was ended; MUTANTS=300: a sample
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.mutation --mutants $(MUTANTS) --least 90

clean: ## Remove the environment and all that was made
	rm -rf $(VENV) build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

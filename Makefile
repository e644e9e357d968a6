# `make run` and `make test` set up everything they need; see README.md.
PYTHON ?= python3
BIN := .venv/bin
# Real photographs of the sky with their truth.json, when there are any.
PHOTOGRAPHS ?= ../shared/data/sky

# Platforms of `make wheels`, for instance PLATFORMS=manylinux_2_17_x86_64; all when it is empty.
PLATFORMS ?=

# What `make mutants` tries, for instance MUTANTS="cubestar --all"; --help says what there is.
MUTANTS ?=

# One more process than cores: some tests wait for a browser or for a clock.
TESTS := -n $(shell expr $$(getconf _NPROCESSORS_ONLN) + 1) --dist loadgroup

# Tests start hundreds of Python processes: let them keep what they have compiled, also where that is
# not usual. Matrices are small: threads of the linear algebra would only wait for one another.
PYTEST := PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/pytest

# Of the gateware's tests: further random numbers, and the simulator, icarus or verilator.
SEED ?= 0
SIMULATOR ?= icarus

# How long `make fuzz` goes on; what fails is kept in out/fuzz.
MINUTES ?= 10

# What `make pasted` pastes; all when it is empty.
DOCUMENTS ?=

# Nothing here is made by a built-in rule: one would make "setup" of setup.sh.
MAKEFLAGS += --no-builtin-rules

.PHONY: help venv run docs test fuzz test-all test-hdl test-clients test-suites pasted firmware mutants lint wheels bench bench-engines bench-history bench-scale fidelity clean

help:
	@echo "make run       set up, then boot the sensors, measure over their serial ports, and draw what they saw"
	@echo "make test      set up, then run the tests, but for those that take long"
	@echo "make test-all  set up, then run those too that take long: this day's part of 28; DAYS=1 runs all but weekly ones, DAYS=0 all"
	@echo "make fuzz      set up, then feed all readers of files and messages with documents that are nearly right"
	@echo "make test-hdl  set up, then simulate the gateware: more than make test does, with coverage"
	@echo "make test-clients  set up, install programs of others, then run them on the emulated ports"
	@echo "make test-suites  set up, install test suites of others, then run them on the simulator; EVERY=20 runs a part"
	@echo "make pasted    paste the commands of README.md and docs/ into a fresh clone, and tell how they end"
	@echo "make firmware  set up, then build CubeStar's program in C with arm-none-eabi-gcc"
	@echo "make mutants   set up, then count the wrong gates that the gateware's testbenches notice; takes long"
	@echo "make docs      set up, then build the documents as a site in out/site"
	@echo "make lint      ruff, mypy, and a check of the prose"
	@echo "make wheels    set up, then build the source distribution and the wheels of all platforms into dist/"
	@echo "make fidelity  set up, then measure the figures of the documents again, within 20 minutes on two idle cores"
	@echo "make bench     measure the cost of the hot paths"
	@echo "make bench-engines  compare the simulators that can run the gateware"
	@echo "make bench-history  write this version's ratios into docs/benchmarks.md"
	@echo "make bench-scale  measure what many skies cost, on an idle machine"
	@echo "make clean     remove .venv, out and caches"

venv: .venv/ready-run

.venv/ready-run: pyproject.toml setup.sh
	@PYTHON=$(PYTHON) ./setup.sh run
	@touch $@

.venv/ready-dev: pyproject.toml setup.sh
	@PYTHON=$(PYTHON) ./setup.sh dev
	@touch $@ .venv/ready-run

run: .venv/ready-run
	@$(BIN)/cubestack demo --out out --photographs "$(PHOTOGRAPHS)"

test: .venv/ready-dev
	@$(PYTEST) $(TESTS)

.venv/ready-board: .venv/ready-dev
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[board]"
	@touch $@

# Makes WebAssembly of the page that runs in the browser.
.venv/ready-compiler: .venv/ready-dev
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[compiler]"
	@touch $@

# Each slow test has its turn on one day in so many, a weekly one in seven at least; 0 runs all of them.
DAYS ?= 28

test-all: .venv/ready-board .venv/ready-compiler
	@$(PYTEST) $(TESTS) -m "slow or not slow" --days $(DAYS)

fuzz: .venv/ready-dev
	@$(BIN)/python -m tests.fuzz.run --minutes $(MINUTES)

pasted:
	@$(PYTHON) -m tests.system.documents.pasted $(DOCUMENTS)

firmware: .venv/ready-run
	@command -v arm-none-eabi-gcc >/dev/null 2>&1 || { \
		echo "make firmware needs a compiler: sudo apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi" >&2; \
		exit 1; }
	@$(MAKE) --no-print-directory -C firmware_model/reference

mutants: .venv/ready-dev
	@$(BIN)/python -m tests.hdl.mutants $(MUTANTS)

test-hdl: .venv/ready-dev
	@HDL_TIER=full HDL_SEED=$(SEED) HDL_SIMULATOR=$(SIMULATOR) HDL_COVERAGE=out/hdl/coverage \
		$(BIN)/pytest tests/hdl examples/*/tests -m cocotb -n auto --junitxml=out/hdl/junit.xml -o junit_logging=system-out \
		-o console_output_style=classic

lint: .venv/ready-dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/python -m tests.prose
	@./typecheck.sh

test-clients: .venv/ready-dev
	@tests/system/clients.sh out/clients
	@CUBESTACK_CLIENTS=$(CURDIR)/out/clients $(PYTEST) -n 0 -m "slow or not slow" -rs tests/system/i2c_programs \
		tests/system/serial_programs

# One in EVERY files of the compiler's suite.
EVERY ?= 1

test-suites: .venv/ready-dev
	@tests/emulator/iss/suites/install.sh
	@CUBESTACK_SUITES=$(EVERY) CUBESTACK_SUITES_SEED=$(SEED) $(PYTEST) -n 0 -m "slow or not slow" -rs -s \
		tests/emulator/iss/suites

# What `make fidelity` renews, for instance FIGURES="cubesense --stale"; all when it is empty.
FIGURES ?=

fidelity: .venv/ready-dev
	@OPENBLAS_NUM_THREADS=1 $(BIN)/cubestack fidelity $(FIGURES) --write
	@OPENBLAS_NUM_THREADS=1 $(BIN)/cubestack hazards $(FIGURES) --frames 8 --seed 1 --out docs
	@$(BIN)/cubestack compare identification $(FIGURES) --out docs
	@$(BIN)/cubestack compare attitude $(FIGURES) --out docs

bench: .venv/ready-run
	@$(BIN)/cubestack bench

wheels: .venv/ready-run
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[release]"
	@SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m cubestack.host.native.wheels dist $(PLATFORMS)

docs: .venv/ready-compiler
	@NO_MKDOCS_2_WARNING=1 COLUMNS=90 $(BIN)/mkdocs build --strict --quiet
	@$(BIN)/python -m docs.make_try
	@echo "out/site/index.html"

bench-engines: .venv/ready-dev
	@$(BIN)/python -m tests.benchmarks.engines

bench-history: .venv/ready-dev
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.history

# Numbers of skies, and the price of a core for an hour.
FRAMES ?= 10 1000 10000
PRICE ?= 0.05

bench-scale: .venv/ready-dev
	@OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.scale $(FRAMES) --price $(PRICE)

clean:
	rm -rf .venv out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -r {} +

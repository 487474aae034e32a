# Two commands for newcomers: `make demo` and `make test`. Only Python 3.11+ and make are needed.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
WORKERS ?= 2

.PHONY: demo test quick check fmus docs fuzz bench wheel clean

demo: $(STAMP)
	$(BIN)/python -m cosim run crawler_paper --out out/crawler_paper
	$(BIN)/python -m cosim run motor_bench --out out/motor_bench

test: $(STAMP)
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

quick: $(STAMP)
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m "not slow"

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

fmus: $(STAMP)
	$(BIN)/python -m cosim fmus build --platform all

docs: $(STAMP)
	$(BIN)/python -m sources.tables
	$(BIN)/python -m benchmarks.tables

fuzz: $(STAMP)
	$(BIN)/python -m tests.fuzz --seconds 3600

bench: $(STAMP)
	$(BIN)/python -m benchmarks.fmu_step
	$(BIN)/python -m benchmarks.masters
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.startup

wheel: $(STAMP)
	$(BIN)/python -m pip wheel --no-deps --wheel-dir dist .

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[build,control,gym,live,study,test,check]"
	touch $(STAMP)

clean:
	rm -rf $(VENV) out dist

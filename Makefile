# Two commands for newcomers: `make demo` and `make test`. Only Python 3.11+ and make are needed.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
RUNS := $(VENV)/.runs
WORKERS ?= 2

# Some containers forbid byte code, which git ignores here. Each command would compile cosim anew, and
# tests start hundreds.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test quick check fmus docs site fuzz bench wheel clean

demo: $(RUNS)
	$(BIN)/python -m cosim run motor_bench --out out/motor_bench
	$(BIN)/python -m cosim diagnose scenarios/motor_bench/data/MB-13 --out out/MB-13
	$(BIN)/python -m cosim run crawler_paper --out out/crawler_paper

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

site: $(STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

fuzz: $(STAMP)
	$(BIN)/python -m tests.fuzz --seconds 3600

bench: $(STAMP)
	$(BIN)/python -m benchmarks.fmu_step
	$(BIN)/python -m benchmarks.masters
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.startup

PLATFORM ?= host
wheel: $(RUNS)
	$(BIN)/python -m sources.distribution --platform $(PLATFORM)
	$(BIN)/python -m pip wheel --no-deps --wheel-dir dist .

# what runs, builds FMUs and diagnoses; the tools of the tests are three times as much. Modules are
# compiled when they are first imported: most of what is installed never is, and it took a minute
$(RUNS): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --no-compile --editable ".[build]"
	touch $(RUNS)

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --no-compile --upgrade pip
	$(BIN)/python -m pip install --quiet --no-compile --editable ".[build,control,docs,gym,live,logs,study,tables,validate,test,check]"
	touch $(RUNS) $(STAMP)

clean:
	rm -rf $(VENV) out dist

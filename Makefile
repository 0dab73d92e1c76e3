# Each target sets up what it needs: .venv/ holds the package, grows by tools for tests, checks and benchmarks, and
# follows pyproject.toml.
PYTHON ?= python3
BIN := .venv/bin
PAGES := docs/reference/api/generated# written anew, or pages stay of what is gone, to which nothing links
TELLING := storage stores plotting_maps explorer_controls cli cluster

.PHONY: help demo test test-all check check-oldest check-newest fuzz bench docs figures dist clean

help:
	@echo "make demo     the paper's whole study as one HTML report in demo/"
	@echo "make test     the tests between two edits, on all cores: minutes"
	@echo "make test-all those and the long ones: random campaigns, kills, clusters, hostile files, notebooks"
	@echo "make check    style, types, layers, documentation"
	@echo "make check-oldest, make check-newest"
	@echo "              tests with the oldest dependencies allowed, and with the newest there are"
	@echo "make fuzz     20,000 hostile requests, as \`make test-all\` does 2,000"
	@echo "make bench    how fast the engine is on this machine, beside others"
	@echo "make docs     the documentation, in docs/_build/html/"
	@echo "make figures  draw again the pictures of README and documentation"
	@echo "make dist     build wheel and source archive, and try the wheel alone"
	@echo "make clean    remove what make made"

.venv/.has-%: pyproject.toml tools/bootstrap.py
	$(PYTHON) tools/bootstrap.py $(filter-out package,$*)
	@touch $@

demo: .venv/.has-package
	$(BIN)/vibroimpact reproduce --out demo --overwrite
	@echo "The report lies at $(CURDIR)/demo/report.html"

# Tests start hundreds of processes; without bytecode each of them compiles the package's source anew.
test test-all: export PYTHONDONTWRITEBYTECODE =
test: TIER = -m "not long"
test test-all: .venv/.has-tests
	$(BIN)/python -m pytest -n auto --dist worksteal $(TIER)

check: .venv/.has-tests .venv/.has-checks
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	rm -rf $(PAGES)
	$(BIN)/sphinx-build -W --keep-going --quiet -b html -D plot_gallery=0 -D nb_execution_mode=off docs docs/_build/check
	$(BIN)/python -m pytest --quiet tests/project/test_docs_built.py

# A fresh environment in build/, resolved anew; what it holds is printed before the tests that meet most dependencies.
check-oldest: EDGE = python3.11 --resolution lowest-direct
check-oldest: WARNINGS = -W default
check-newest: EDGE = $(shell for v in 14 13 12 11; do python3.$$v -V >/dev/null 2>&1 && echo python3.$$v && break; done) \
  --prerelease disallow --upgrade
check-oldest check-newest: .venv/.has-tests .venv/.has-checks
	$(BIN)/uv venv --quiet --clear --no-python-downloads --python $(firstword $(EDGE)) build/$@
	$(BIN)/uv pip install --quiet --python build/$@ $(wordlist 2,9,$(EDGE)) --editable '.[test,cluster,web]'
	$(BIN)/uv pip list --python build/$@
	NUMBA_CACHE_DIR=$(CURDIR)/build/$@/numba build/$@/bin/python -m pytest -n auto --dist worksteal $(WARNINGS) $(TELLING:%=tests/*/test_%.py)

fuzz: .venv/.has-tests
	FUZZ=40 $(BIN)/python -m pytest -n auto tests/*/test_fuzz.py tests/*/test_hostile_files.py tests/*/test_advice.py \
	  tests/*/test_random_systems.py tests/*/test_compliant_orbits.py tests/*/test_scaling.py tests/*/test_agreement.py \
	  tests/*/test_endings.py

bench: export PYTHONDONTWRITEBYTECODE =
bench: .venv/.has-tests .venv/.has-benchmarks
	$(BIN)/python -m benchmarks.run

docs: .venv/.has-tests .venv/.has-checks
	rm -rf $(PAGES)
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html
	@echo "The documentation lies at $(CURDIR)/docs/_build/html/index.html"

figures: .venv/.has-tests .venv/.has-checks
	$(BIN)/python docs/figures.py

dist: .venv/.has-checks
	$(BIN)/python tools/dist.py

clean:
	rm -rf .venv demo docs/_build docs/gallery docs/reference/api/generated build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests benchmarks examples docs tools -name __pycache__ -type d -prune -exec rm -rf {} +

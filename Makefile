# Two commands do it all on a fresh machine: `make leaderboard` and `make test`.
PYTHON ?= python3
VENV ?= .venv
RESULTS ?= results/quick
SITE ?= site
DOCS ?= site-docs
BIN := $(VENV)/bin

.PHONY: help leaderboard test bench audit docs clean

help:
	@echo "make leaderboard   set up, run the quick campaign, print the ranking, write the site"
	@echo "make test          set up and run all tests (lint, types and floors included)"
	@echo "make bench         set up and run the benchmarks, one table"
	@echo "make docs          set up and build the documentation as a site in $(DOCS)"
	@echo "make audit         measure what the benchmark promises, one table"
	@echo "make clean         remove the environment, results and site"

$(VENV)/pyvenv.cfg:
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("simnav needs Python 3.11 or newer, and $(PYTHON) is " + sys.version.split()[0] + "; say e.g. make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

# A stamp for each set of packages: installed again when pyproject.toml changes.
$(VENV)/installed: $(VENV)/pyvenv.cfg pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/installed-test: $(VENV)/pyvenv.cfg pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@touch $@ $(VENV)/installed

leaderboard: $(VENV)/installed
	$(BIN)/simnav campaign --profile quick --output $(RESULTS)
	$(BIN)/simnav leaderboard $(RESULTS) --output $(SITE)

# Kernels are compiled once, on all cores, and not by each process of the tests. Some tests wait for other processes: four
# workers keep two cores busy. The tests start hundreds of processes: Python keeps what it compiled for them.
test: $(VENV)/installed-test
	$(BIN)/simnav warmup
	env -u PYTHONDONTWRITEBYTECODE OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses=4 --dist=worksteal

bench: $(VENV)/installed-test
	$(BIN)/simnav warmup
	@mkdir -p results
	$(BIN)/python -m pytest tests/benchmarks --benchmark-enable --benchmark-only --benchmark-quiet --benchmark-json=results/bench.json
	$(BIN)/python -m tests.benchmarks.table results/bench.json

$(VENV)/installed-docs: $(VENV)/pyvenv.cfg pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@ $(VENV)/installed

docs: $(VENV)/installed-docs
	$(BIN)/python -m mkdocs build --strict --site-dir $(DOCS)

audit: $(VENV)/installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.audit

clean:
	rm -rf $(VENV) $(RESULTS) $(SITE) $(DOCS) build dist *.egg-info

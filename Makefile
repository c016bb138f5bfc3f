# Two commands do everything on a fresh machine with Python 3.11 or newer: make demo, make test.

NEW_ENOUGH := import sys; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for python in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$python -c '$(NEW_ENOUGH)' 2>/dev/null && echo $$python && break; done)
VENV := .venv
BIN := $(VENV)/bin
DEMO := demo
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
unexport PYTHONDONTWRITEBYTECODE  # with it each of hundreds of processes would compile all modules anew

.PHONY: demo test test-all score mutants findings check format lint types layers docs site hooks chromium clean

# On a copy of the pipeline: the model fails, what it lacks is named and added, the error falls; then all the rest.
demo: $(VENV)/.installed-all
	@mkdir -p $(DEMO) && cp pipelines/demo.toml $(DEMO)/pipeline.toml
	$(BIN)/pneucli compare $(DEMO)/pipeline.toml
	$(BIN)/pneucli diagnose $(DEMO)/pipeline.toml
	$(BIN)/pneucli add $(DEMO)/pipeline.toml --suggested
	$(BIN)/pneucli run $(DEMO)/pipeline.toml
	@echo "the same with your own hands, in the browser: $(BIN)/pneucli workbench $(DEMO)/pipeline.toml"

# The checks run beside the tests, so that one go tells all and no core waits; what fails makes the whole fail.
test: $(VENV)/.installed-dev hooks chromium
	@$(MAKE) --no-print-directory --keep-going check & checks=$$!; \
	$(BIN)/python -m pytest -n 2 --dist worksteal --durations 20; tested=$$?; \
	wait $$checks && exit $$tested

# All tests, those of slow benchmarks as well.
test-all: $(VENV)/.installed-dev hooks chromium
	@$(BIN)/python -m pytest -n 2 --dist worksteal -m ""

# The answers to all cases at hand against the stored ones, better or worse: a sample of each world, or FULL=1 all.
# JOBS=1 asks for one case at a time; PROGRAM=folder scores the program in another checkout; WRITE=1 stores the answers.
score: $(VENV)/.installed-dev
	@$(BIN)/python -m benchmarks.score $(if $(FULL),--full) $(if $(JOBS),--jobs $(JOBS)) \
		$(if $(PROGRAM),--program $(PROGRAM)) $(if $(WRITE),--write) $(WORLDS)

# Small faults, put into the code one at a time: of 300, unit tests have to notice 85 in 100. SEED=7 repeats a sample.
mutants: $(VENV)/.installed-dev
	@$(BIN)/python -m tests.mutants $(if $(SEED),--seed $(SEED))

# What other packages do, by scripts that install them; outside CI. All run, and any that changed makes the whole fail.
findings:
	@mkdir -p build; failed=0; for script in findings/*.sh; do \
		if $$script > build/finding.txt 2>&1; then echo "pass $$script"; else echo "CHANGED $$script"; cat build/finding.txt; failed=1; fi; \
	done; exit $$failed

check: format lint types layers

format lint types layers: $(VENV)/.installed-dev

format:
	@$(BIN)/ruff format --check --quiet .

lint:
	@$(BIN)/ruff check --quiet .

types:
	@$(BIN)/mypy --no-error-summary

layers:
	@$(BIN)/lint-imports --no-logo

# Pages that are made from the program, then the site, every link of it checked: build/site/index.html
docs: $(VENV)/.installed-dev
	@$(BIN)/python -m pneucli.cli.docs docs
	@$(MAKE) --no-print-directory site

site: $(VENV)/.installed-dev
	@$(BIN)/python docs/build_site.py

# A stamp per set of dependencies; a changed pyproject.toml installs anew. Of the many modules that dev brings few are
# imported: those are compiled then, which takes half a minute less.
$(VENV)/.installed-%: pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed; name it: make PYTHON=..." >&2; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check $(if $(filter dev,$*),--no-compile) --editable '.[$*]'
	@$(MAKE) --no-print-directory hooks
	@touch $@

# The hook that checks subjects of commits, in a git checkout; elsewhere there is nothing to do.
hooks:
	@if test -e .git; then git config core.hooksPath .githooks; fi

# The browser tests need Chromium: installed where that is possible without asking, else those tests skip.
chromium:
	@.ci/chromium

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

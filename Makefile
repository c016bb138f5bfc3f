# Two commands do everything on a fresh machine with Python 3.11 or newer: make demo, make test.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1

.PHONY: demo test check docs chromium clean

demo: $(VENV)/.installed-all
	@$(BIN)/pneucli run pipelines/demo.toml

test: $(VENV)/.installed-dev chromium check
	@$(BIN)/python -m pytest -n 2

check: $(VENV)/.installed-dev
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo

docs: $(VENV)/.installed-dev
	@$(BIN)/python -m pneucli.cli.docs > docs/cli.md

# A stamp per set of dependencies; a changed pyproject.toml installs anew.
$(VENV)/.installed-%: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, %s is %s; try: make PYTHON=python3.12" \
		% (sys.executable, sys.version.split()[0]) if sys.version_info < (3, 11) else 0)'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]'
	@touch $@

# The browser tests need Chromium: installed where that is possible without asking, else those tests skip.
chromium:
	@.ci/chromium

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

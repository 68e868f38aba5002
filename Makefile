# Needs Python 3.11 or later and make, nothing else. `make help` lists what there is.

SHELL   := /bin/sh
PYTHON  ?=
PYTHONS := $(or $(PYTHON),python3 python3.13 python3.12 python3.11 python3.14 python)
CORE    := .venv
NODE    := tests/node
TEST    := .venv-test
PIP     := -m pip --disable-pip-version-check --quiet
PINS    := -c constraints.txt

.DEFAULT_GOAL := help
.PHONY: help demo test lint format clean

help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## /{printf "make %-8s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

demo: $(CORE)/.installed ## fill a gap in a real clip and show the result (installs the core, no torch)
	@$(CORE)/bin/interpose demo

test: lint $(NODE)/.installed ## all checks and all tests (installs torch)
	@OMP_NUM_THREADS=1 $(TEST)/bin/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile

lint: $(TEST)/.installed ## style, types and the direction of imports
	@$(TEST)/bin/ruff check
	@$(TEST)/bin/ruff format --check
	@$(TEST)/bin/mypy
	@$(TEST)/bin/lint-imports --no-cache

format: $(TEST)/.installed ## put the code into the one format
	@$(TEST)/bin/ruff check --fix-only --quiet
	@$(TEST)/bin/ruff format

clean: ## remove environments, caches and build results
	rm -rf $(CORE) $(TEST) build dist .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	rm -rf $(NODE)/node_modules $(NODE)/.installed
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The first Python that is new enough and can make environments; PYTHON=... chooses another.
define MAKE_VENV
@for python in $(PYTHONS); do \
    if $$python -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
        echo "Setting up $(@D) with $$($$python --version) ..."; \
        rm -rf $(@D) && exec $$python -m venv $(@D); \
    fi; \
done; \
echo "No usable Python was found." >&2; \
echo "interpose needs Python 3.11 or later, with its venv module (tried: $(PYTHONS))." >&2; \
echo "Install one (on Debian and Ubuntu also the package python3-venv), or name yours: make $(MAKECMDGOALS) PYTHON=/path/to/python3" >&2; \
exit 1
endef

# A stamp, written last: an interrupted set-up starts again, a finished one costs nothing.
$(CORE)/.installed: pyproject.toml constraints.txt
	$(MAKE_VENV)
	@$(CORE)/bin/python $(PIP) install $(PINS) --editable .
	@touch $@

# The runtime of browsers, for one test: without Node it is skipped.
$(NODE)/.installed: $(NODE)/package-lock.json
	@! command -v npm >/dev/null || npm ci --prefix $(NODE) --ignore-scripts --no-audit --no-fund --silent || \
	    echo "onnxruntime-web could not be installed: the test of graphs in a browser is skipped." >&2
	@touch $@

# torch comes first and by its exact pin: a bare range may replace a CPU build that is already there.
$(TEST)/.installed: pyproject.toml constraints.txt
	$(MAKE_VENV)
	@$(TEST)/bin/python $(PIP) install $(PINS) torch
	@$(TEST)/bin/python $(PIP) install $(PINS) --editable '.[dev,train,plot]'
	@touch $@

# One environment, .venv, made on demand by every target that needs it. PYTHON=python3.12 make install picks another Python.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install benchmark speed test test-slow docs links core check lint types format clean

VENV := .venv
BIN := $(abspath $(VENV))/bin
STAMP := $(VENV)/.installed
TYPECHECK := build/typecheck
ARGS ?=
WORKERS ?= 2

# pip would compile all that it installs, most of which is never imported; Python compiles what is, once, and keeps it.
unexport PYTHONDONTWRITEBYTECODE

# The first Python that runs and is new enough: a version manager may put a dead `python3.11` on the path.
ifeq ($(origin PYTHON), undefined)
PYTHON = $(shell for p in python3.11 python3 python; do \
	"$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo "$$p" && break; done)
endif

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-11s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

install: $(STAMP) ## make .venv with the tested versions of everything (again only when the requirements change)

# rl-zoo3 brings imageio-ffmpeg, whose wheel holds 164 MB of video coder that nothing here calls; its source has none.
$(STAMP): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "make: no Python 3.11 or newer found; name one with PYTHON=…" >&2; exit 1; }
	@rm -f $@
	@test -x $(BIN)/pip || "$(PYTHON)" -m venv --clear $(VENV)
	@echo "Installing into $(VENV) (minutes the first time) …"
	@$(BIN)/python -m pip install --no-compile --quiet --disable-pip-version-check --progress-bar off \
		--no-binary imageio-ffmpeg -c constraints.txt -e '.[all,dev]'
	@touch $@

benchmark: $(STAMP) ## compare all estimators on all environments, quick form; options in ARGS="…"
	$(BIN)/poise benchmark --quick $(ARGS)

speed: $(STAMP) ## steps a second of environments and estimators; options in ARGS="…"
	$(BIN)/poise speed $(ARGS)

test: check ## lint, types and the tests of every day; ARGS="-k name" picks some
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile $(ARGS)

test-slow: $(STAMP) ## the long tests: training, long rollouts
	$(BIN)/python -m pytest -m slow $(ARGS)

docs: $(STAMP) ## the documentation site, tutorials executed, in build/docs; a warning is an error
	$(BIN)/python -m sphinx -W --keep-going -b html docs build/docs $(ARGS)

links: $(STAMP) ## check the external links of the documentation (needs a network)
	$(BIN)/python -m sphinx -b linkcheck -D plot_gallery=0 docs build/links

core: $(STAMP) ## the core without extras, from the wheel, on every newer Python found here
	.ci/core

check: lint types ## lint, formatting, types

lint: $(STAMP) ## ruff: lint and formatting
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# Types are checked on a copy named poise, so that the folder of the clone may have any name.
types: $(STAMP) ## mypy
	@rm -rf $(TYPECHECK)
	@$(BIN)/python -c 'import setuptools; setuptools.setup()' --quiet build_py --build-lib $(TYPECHECK)
	cd $(TYPECHECK) && $(BIN)/python -m mypy --config-file $(CURDIR)/pyproject.toml --cache-dir $(CURDIR)/.mypy_cache -p poise

format: $(STAMP) ## put the code into the common form
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean: ## remove what was built, .venv and runs/ excepted
	rm -rf build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis *.egg-info
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

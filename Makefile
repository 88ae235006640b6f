# `make run` and `make test` set up by themselves; `make check` is the gate.
# Another Python for the environment: `make setup BASE=python3.12`; an environment of your own: `make test PYTHON=python`.
BASE ?= python3
VENV ?= .venv
PYTHON ?= $(VENV)/bin/python
METHOD ?= exp
REACHES ?= synthetic
ARGS ?=
TORCH_INDEX ?=

# On Linux, PyTorch's own index has a CPU build, which is smaller: make setup TORCH_INDEX=<its address>.
TORCH ?= torch==2.13.0

# Tests render off screen: EGL where the system has it, OSMesa else.
export MUJOCO_GL ?= $(shell ldconfig -p 2>/dev/null | grep -q libEGL.so.1 && echo egl || echo osmesa)

.PHONY: setup run test check bench docs
.DEFAULT_GOAL := test

READY = $(VENV)/.ready
ifeq ($(PYTHON),$(VENV)/bin/python)
ENVIRONMENT = $(READY)
endif

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(BASE) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet $(if $(TORCH_INDEX),--index-url $(TORCH_INDEX)) $(TORCH)
	$(VENV)/bin/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	touch $@

run: $(ENVIRONMENT)
	$(PYTHON) -m dextron_bench run --method $(METHOD) --reaches $(REACHES) $(ARGS)

test: $(ENVIRONMENT)
	$(PYTHON) -m pytest -q -n 2 $(ARGS)

check: $(ENVIRONMENT)
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m pyright --pythonpath $(PYTHON)
	$(PYTHON) -m pytest -q -n 0 tests/test_english.py
	$(MAKE) test
	$(PYTHON) -m pytest -q -n 2 -m slow

bench: $(ENVIRONMENT)
	mkdir -p .benchmarks
	$(PYTHON) -m pytest -q -o addopts= tests/benchmarks --benchmark-json=.benchmarks/bench.json $(ARGS)
	$(PYTHON) tests/benchmarks/table.py .benchmarks/bench.json docs/benchmarks.md

# The documentation site, in site/. To read it: python3 -m http.server -d site
docs: $(ENVIRONMENT)
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict

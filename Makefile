# `make run` and `make test` set up by themselves; `make check` is the gate.
# Another Python for the environment: `make setup BASE=python3.12`; an environment of your own: `make test PYTHON=python`.
BASE ?= python3
VENV ?= .venv
PYTHON ?= $(VENV)/bin/python
METHOD ?= exp
REACHES ?= synthetic
SPLIT ?= test
ARGS ?=

# PyTorch's own index has a CPU build. PyPI's build for Linux needs gigabytes of CUDA, which only a GPU makes use of.
TORCH ?= torch==2.13.0
TORCH_INDEX ?= $(shell command -v nvidia-smi >/dev/null || echo https://download.pytorch.org/whl/cpu)

# Python compiles what it imports; to compile every file of every package takes a minute.
INSTALL = $(VENV)/bin/python -m pip install -qq --disable-pip-version-check --no-compile -c constraints.txt
TORCH_ALONE = $(INSTALL) --no-deps $(TORCH)
DM_CONTROL = dm-control dm-env dm-tree lxml wrapt

.PHONY: setup run test check bench rebuild docs
.DEFAULT_GOAL := test

RUNTIME = $(VENV)/.runtime
DEVELOPMENT = $(VENV)/.development
ifneq ($(PYTHON),$(VENV)/bin/python)
RUNTIME =
DEVELOPMENT =
endif

setup: $(DEVELOPMENT)

# What the benchmark itself needs. Without an answer from PyTorch's index, PyTorch comes from PyPI.
$(VENV)/.runtime: pyproject.toml constraints.txt
	@echo "setting up $(VENV); the downloads are 0.6 GB, or several with PyTorch for a GPU"
	@$(BASE) -m venv $(VENV)
	@$(if $(TORCH_INDEX),$(TORCH_ALONE) --retries 0 --extra-index-url $(TORCH_INDEX) 2>/dev/null ||) $(TORCH_ALONE)
	@$(INSTALL) -e .
	@touch $@

# What tests, documentation and checks need beside it. dm-control comes without its requirement labmaze where that has no
# wheel; it comes last, since pip complains about labmaze whenever it installs something later.
$(VENV)/.development: $(VENV)/.runtime
	@echo "adding what the tests need to $(VENV)"
	@$(INSTALL) -e '.[dev]'
	@$(VENV)/bin/python -c 'import dm_control' 2>/dev/null || $(INSTALL) --no-deps $(DM_CONTROL)
	@touch $@

run: $(RUNTIME)
	$(PYTHON) -m dextron_bench run --method $(METHOD) --reaches $(REACHES) --split $(SPLIT) $(ARGS)

test: $(DEVELOPMENT)
	$(PYTHON) -m pytest -q -n 2 $(ARGS)

check: $(DEVELOPMENT)
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m ruff check .
	$(PYTHON) -m pyright --pythonpath $(PYTHON)
	$(PYTHON) -m pytest -q -n 0 tests/test_english.py
	$(MAKE) test
	$(PYTHON) -m pytest -q -n 2 -m slow

bench: $(DEVELOPMENT)
	mkdir -p .benchmarks
	$(PYTHON) -m pytest -q -o addopts= tests/benchmarks --benchmark-json=.benchmarks/bench.json $(ARGS)
	$(PYTHON) tests/benchmarks/table.py .benchmarks/bench.json docs/benchmarks.md

# Everything that depends on the physics, as far as it is stale (docs/rebuild.md): `make rebuild ARGS=--list` shows it.
rebuild: $(RUNTIME)
	$(PYTHON) -m tools.rebuild $(ARGS)

# The documentation site, in site/. To read it: python3 -m http.server -d site
docs: $(DEVELOPMENT)
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict

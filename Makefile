# One command each: `make setup`, `make demo`, `make test`, `make check`, `make benchmarks`.
VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3.10 || command -v python3)
ARGS ?=
FUZZ_CASES ?= 10000

# One thread per process: the node graph and the test workers already fill the cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Where Python is told not to keep compiled modules, each node compiles 300 of them when it starts.
unexport PYTHONDONTWRITEBYTECODE

# Tests that `make site` runs.
BY_SITE := tests/tools/test_notebooks.py tests/tools/test_site.py

.PHONY: help setup build interfaces ubuntu demo test fuzz truth coverage check format lint types imports budget benchmarks pictures reference site dist clean

help:
	@echo "make setup     set up .venv with what the product needs"
	@echo "make build     set up .venv with what developers need, and build the ROS workspace"
	@echo "make demo      the whole loop: demonstrate, record, learn, navigate, report  (ARGS='--help'),"
	@echo "               and four robots on the same seeds"
	@echo "make test      every test                                                    (ARGS='-k name')"
	@echo "make interfaces  build nav2_msgs, which has no wheel, for tests and for Nav2 (needs g++)"
	@echo "make ubuntu    tests of mathematics and strategy with NumPy and SciPy of Ubuntu 24.04"
	@echo "make fuzz      mutated messages, files and arguments, 10,000 per target   (FUZZ_CASES=1000)"
	@echo "make truth     recordings of a foreign robot: each headline, its checks, and drives by what was learned"
	@echo "make coverage  every test, and which lines and branches they reach"
	@echo "make check     format, lint, types, import rules, budget of lines, tests"
	@echo "               another Python: make check PYTHON=python3.10 VENV=.venv310"
	@echo "make benchmarks  speed, results as JSON"
	@echo "make pictures  draw the pictures of the documents again (needs Graphviz and Chromium)"
	@echo "               after a change of the demo: make pictures ARGS='--demo demo_output/run-1'"
	@echo "make reference write nodes.yaml and the tables of docs from the settings models"
	@echo "make site      build the documents as a site in site/, strictly (Python 3.11 or 3.12)"
	@echo "make dist      build the wheels and source distributions, and check their metadata"
	@echo "make clean     remove .venv, builds and caches (never your demo output)"

PROJECTS := pyproject.toml serd_core/pyproject.toml bags/pyproject.toml lab/pyproject.toml constraints.txt tools/setup_venv.sh

# What a target needs: run (the product), all (and what developers need), docs (and the site's tools).
$(VENV)/.run $(VENV)/.all $(VENV)/.docs: $(PROJECTS)
	@PYTHON="$(PYTHON)" VENV="$(VENV)" bash tools/setup_venv.sh $(subst .,,$(notdir $@))

setup: $(VENV)/.run

build: $(VENV)/.all
	@bash tools/build_workspace.sh $(BIN)

interfaces: $(VENV)/.all
	@bash tools/build_interfaces.sh $(BIN)

ubuntu:
	@PYTHON="$(PYTHON)" bash tools/test_ubuntu_versions.sh $(ARGS)

demo: $(VENV)/.run
	@$(BIN)/serd demo $(ARGS)
	@echo "four robots now drive two tasks on eight seeds each, in some minutes; Ctrl-C leaves them out"
	@$(BIN)/python -m lab robots --config lab/experiments/study/robots/robots_study_demo.yaml --output lab/results/robots_demo

test: build
	@$(BIN)/python -m pytest -n 3 --dist worksteal $(BY_SITE:%=--ignore=%) $(ARGS)

fuzz: build
	@SERD_FUZZ_CASES=$(FUZZ_CASES) $(BIN)/python -m pytest -n 2 --dist worksteal --timeout=0 -s -v tests/fuzz $(ARGS)

truth: $(VENV)/.all
	@$(BIN)/python -m lab truth $(ARGS)

coverage: build
	@$(BIN)/python -m pytest -n 3 --dist worksteal --cov --cov-report=term:skip-covered $(ARGS)

check: format lint types imports budget test

format: $(VENV)/.all
	@$(BIN)/ruff format --check .

lint: $(VENV)/.all
	@$(BIN)/ruff check .
	@$(BIN)/hadolint $$(git ls-files '*Dockerfile*' '*Containerfile*')

# The types of NumPy 2.2, the newest for Python 3.10, are incomplete.
types: $(VENV)/.all
	@if $(BIN)/python -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then $(BIN)/mypy; \
	else echo "types: checked on Python 3.11 and 3.12"; fi

imports: $(VENV)/.all
	@$(BIN)/lint-imports

budget: $(VENV)/.all
	@$(BIN)/python tools/check_budget.py

benchmarks: build
	@$(BIN)/python -m lab benchmarks $(ARGS)

pictures: build
	@$(BIN)/python tools/draw_architecture.py
	@$(BIN)/python tools/draw_pictures.py $(ARGS)

reference: $(VENV)/.all
	@$(BIN)/python tools/write_reference.py

site: $(VENV)/.docs
	@$(BIN)/python -m pytest -q tests/tools/test_notebooks.py
	@$(BIN)/python tools/build_site.py
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q
	@$(BIN)/python -m pytest -q tests/tools/test_site.py
	@echo "site: $(CURDIR)/site/index.html"

dist: $(VENV)/.docs
	@rm -rf dist
	@for project in serd_core bags .; do $(BIN)/python -m build -q --outdir dist $$project || exit 1; done
	@$(BIN)/twine check --strict dist/*

clean:
	rm -rf $(VENV) build serd_core/build bags/build ros_ws/build ros_ws/install ros_ws/log .mypy_cache .ruff_cache .pytest_cache .hypothesis

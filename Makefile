# make          this help
# make demo     a picture in out/demo.png, from a fresh clone
# make test     everything that must pass before a commit

VENV  := .venv
BIN   := $(VENV)/bin
PIP   := $(BIN)/python -m pip install --disable-pip-version-check --no-compile -c constraints.txt
PYTHON ?=
ARGS   ?=

.DEFAULT_GOAL := help
.PHONY: help install develop llvm demo test test-slow mutants bench lint format clean distclean
.DELETE_ON_ERROR:

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@echo
	@echo "  PYTHON=python3.12 chooses the interpreter, ARGS='-k name' goes to pytest or to the benchmark."

install: $(VENV)/.installed ## create .venv and install stratalux there, with its command .venv/bin/stratalux

develop: $(VENV)/.developed ## install what the checks need besides

$(VENV)/.installed: pyproject.toml constraints.txt
	@PYTHON='$(PYTHON)' scripts/bootstrap.sh venv $(VENV)
	$(PIP) -e '.[assets,compare,gltf]'
	@touch $@

$(VENV)/.developed: $(VENV)/.installed
	$(PIP) -e '.[dev]'
	@touch $@

llvm: install ## make sure that Dr.Jit finds a shared LLVM library
	@scripts/bootstrap.sh llvm $(VENV)

demo: llvm ## render the demo scene to out/demo.exr and out/demo.png
	@mkdir -p out
	$(BIN)/stratalux render demo --spp 16 -o out/demo.exr -o out/demo.png
	@echo
	@echo 'The picture is out/demo.png, the command $(BIN)/stratalux. To type its name alone, say'
	@echo '  export PATH="$(CURDIR)/$(BIN):$$PATH"'
	@echo 'and then, for instance,'
	@echo '  stratalux --help'
	@echo '  stratalux assets fetch'

test: lint llvm ## lint, type-check and run the tests
	@scripts/test.sh $(BIN)/python $(ARGS)

test-slow: develop llvm ## run the statistical tests that take minutes
	$(BIN)/python -m pytest -m slow $(ARGS)

mutants: develop llvm ## put mistakes into a copy of the code, and list those no test finds; hours, or ARGS=maps/geometry.py
	$(BIN)/python -m scripts.mutants $(ARGS)

bench: llvm ## measure against the best of Mitsuba's own, on an idle machine; ARGS='--suite full' takes an hour
	$(BIN)/stratalux bench $(ARGS)

lint: develop ## ruff, mypy and the order of the layers, without changing a file
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

format: develop ## let ruff fix and format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean: ## remove outputs and caches
	rm -rf out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find src tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## remove .venv too
	rm -rf $(VENV)

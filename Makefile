# Two commands from a fresh clone:  make demo  and  make test.  See README.md.

PYTHON ?= python3
VENV ?= .venv
OUT ?= out/demo
BIN := $(VENV)/bin
export OMP_NUM_THREADS ?= 1
export MPLBACKEND ?= Agg

.DEFAULT_GOAL := help

# Scripts use a name again for something else, and take what may be None for what it is. Names that are gone are errors.
SCRIPT_TYPES := --allow-redefinition-new --local-partial-types --follow-imports silent --cache-dir .mypy_cache/scripts \
	--disable-error-code union-attr --disable-error-code arg-type --disable-error-code operator

.PHONY: help demo bench test test-slow lint unit mutations coverage times wheel resolve notebook docs pictures benchmark-records clean

help: ## what can be made
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@$(PYTHON) tests/slow_parts.py --list

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo 'expected Python 3.11 or newer; name one: make PYTHON=python3.12 ...' >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@bash .ci/system_libraries.sh $(BIN)/python pydrake.common
	@touch $@

$(VENV)/.installed-test: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,notebooks,robots,bags,mujoco,onnx,cluster,solvers,docs]'
	@bash .ci/system_libraries.sh $(BIN)/python pydrake.common proxsuite
	@touch $@ $(VENV)/.installed

demo: $(VENV)/.installed ## install, simulate a bench, close the loop on it; the last line is the report
	@$(BIN)/drake-tc demo --out $(OUT)

bench: $(VENV)/.installed-test ## run a benchmark: NAME=tick; without NAME, list them
	$(BIN)/python -m tests.benchmarks $(NAME)

# What uses one core each runs beside each other; the unit tests use two, and timings want to be alone.
test: $(VENV)/.installed-test ## all checks, about fifteen minutes on two cores
	@$(MAKE) --no-print-directory --jobs 2 lint wheel
	@$(MAKE) --no-print-directory unit
	@$(MAKE) --no-print-directory times

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy $(SCRIPT_TYPES) notebooks/*.py

unit: $(VENV)/.installed-test
	$(BIN)/pytest -q -n 2 --dist loadscope -m 'not slow and not benchmark'

mutations: $(VENV)/.installed-test ## put twenty faults into a copy, one at a time: which ones do the fast tests find? NAMES="ratio spring"
	$(BIN)/python tests/mutations.py $(NAMES)

coverage: $(VENV)/.installed-test ## the same tests, and which lines they reach
	$(BIN)/pytest -q -n 2 --dist loadscope -m 'not slow and not benchmark' --cov drake_tc --cov-report term:skip-covered

# The files are named: to collect all other tests takes as long as these.
times: $(VENV)/.installed-test ## what one tick costs, measured in rounds: other work on the machine does no harm
	$(BIN)/pytest -q -m 'benchmark and not slow' $$(grep -rl --include='test_*.py' 'mark\.benchmark' tests)

wheel: $(VENV)/.installed-test ## build the wheel and run the demo from it, in an empty environment
	bash .ci/wheel.sh $(BIN)/python

resolve: $(VENV)/.installed ## resolve all dependencies from wheels for Python 3.12 to 3.14; installs nothing
	bash .ci/resolve.sh $(BIN)/python

test-slow: $(VENV)/.installed-test ## long reproductions and benchmarks, all parts; one of them: PART=name
	$(BIN)/python tests/slow_parts.py $(PART)

notebook: $(VENV)/.installed-test ## run the notebooks' scripts and store them rendered
	for script in notebooks/*.py; do \
		$(BIN)/jupytext --quiet --to notebook "$$script" && \
		MPLBACKEND=module://matplotlib_inline.backend_inline $(BIN)/jupyter execute --inplace --timeout=-1 "$${script%.py}.ipynb" || exit 1; \
	done

docs: $(VENV)/.installed-test ## build the documentation site into out/site; warnings are errors
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict
	@echo out/site/index.html

pictures: $(VENV)/.installed-test ## draw the stored pictures of the documentation; some of them: NAMES="logs run"
	$(BIN)/python docs/draw_pictures.py $(NAMES)
	@echo 'commit the pictures, then: $(BIN)/python docs/record_pictures.py'

benchmark-records: $(VENV)/.installed-test ## run benchmarks and store their results for the documentation: NAMES="leg qp"
	$(BIN)/python docs/record_benchmark.py $(NAMES)

clean: ## remove what was built or written here, and the environment
	rm -rf $(VENV) build dist out *.egg-info .coverage .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# PYTHON=/path/to/python3.11 chooses the interpreter; PYTEST_ARGS adds to the test run, and
# MUTANTS_ARGS to the trial of the tests.
BOOTSTRAP_PYTHON = $(shell command -v $(or $(PYTHON),python3))
BIN = .venv/bin
PYTEST_ARGS ?= -n 2

.PHONY: coverage demo docs test lint mutants venv

demo: venv
	$(BIN)/lmsco demo

test: venv
	$(BIN)/python -m pytest $(PYTEST_ARGS)

# Which lines the tests run: build/coverage/index.html. Core and node have a floor.
coverage: venv
	$(BIN)/python -m pytest $(PYTEST_ARGS) --cov --cov-report=html
	$(BIN)/python -m coverage report --skip-covered --include='lmsco_ros/core/*,lmsco_ros/node/*' --fail-under=92

lint: venv
	$(BIN)/python -m pytest test/package/test_lint.py

# The pages: build/docs/index.html. What stands in the code is written from there first.
docs: venv
	$(BIN)/python scripts/configuration_page.py
	$(BIN)/python scripts/module_table.py
	$(BIN)/python scripts/public_api.py
	$(BIN)/python -m sphinx -W --keep-going -q docs build/docs

# Whether the tests notice when the heart of the tracker is changed.
mutants: venv
	$(BIN)/python -m scripts.mutants $(MUTANTS_ARGS)

venv:
	@test -n "$(BOOTSTRAP_PYTHON)" || { echo 'lmsco_ros: $(or $(PYTHON),python3) is not there; install it: sudo apt install python3 python3-venv' >&2; exit 1; }
	@'$(BOOTSTRAP_PYTHON)' scripts/bootstrap.py

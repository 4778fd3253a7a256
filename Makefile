# The README's two commands are `make demo` and `make test`; both set everything up first.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.ready

.PHONY: setup demo test lint check clean

setup: $(STAMP)

# Made again when the dependencies change; otherwise nothing to do.
$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "rgbn needs Python 3.11 or later; $(PYTHON) is older. Run: make PYTHON=/path/to/python3.11 setup"; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || sh docs/system-packages.sh python3-venv
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@sh docs/system-packages.sh libllvm19 || true
	@touch $(STAMP)

demo: setup
	$(BIN)/rgbn demo

test: setup
	$(BIN)/python -m pytest -n auto -q

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

check: lint test

clean:
	rm -rf .venv out

# The README's two commands are `make demo` and `make test`; both set everything up first.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

.PHONY: setup demo test test-all lint check clean

setup: $(READY)

# Made again when the dependencies change; otherwise there is nothing to do.
$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "rgbn needs Python 3.11 or later; $(PYTHON) is older. Run: make PYTHON=/path/to/python3.11 setup" >&2; exit 2; }
	@$(PYTHON) lab/system_libraries.py
	@$(PYTHON) -m venv .venv || { echo "Run: sudo apt-get install python3-venv" >&2; exit 2; }
	@echo "installing Python packages into .venv (a minute or two)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $(READY)

demo: setup
	@$(BIN)/rgbn demo

test: setup
	@$(PYTHON) lab/system_libraries.py --browser
	$(BIN)/python -m pytest -n 2 --dist loadfile -q -m "not full"

# As well as what would take `make test` beyond twenty minutes on two cores.
test-all: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile -q

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --threads 2

check: lint test

clean:
	rm -rf .venv out

# The README's two commands are `make demo` and `make test`; both set everything up first.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check
# Python keeps what it compiled, whatever the environment says: the tests start it often.
TEST = env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -q

.PHONY: setup lock demo gallery docs gates gates-compare test test-all test-full test-latest lint check clean

setup: $(READY)

# Made again when the dependencies change; otherwise there is nothing to do.
$(READY): pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "rgbn needs Python 3.11 or later; $(PYTHON) is older. Run: make PYTHON=/path/to/python3.11 setup" >&2; exit 2; }
	@$(PYTHON) rgbn/system_libraries.py
	@$(PYTHON) -m venv .venv || { echo "Run: sudo apt-get install python3-venv" >&2; exit 2; }
	@echo "installing Python packages into .venv (a minute or two)"
	@$(PIP) --require-hashes --requirement requirements.lock
	@$(PIP) --no-deps --no-build-isolation --editable .
	@echo "compiling the kernels (a minute or two)"
	@out=$$(mktemp -d); $(BIN)/rgbn --quiet process fixtures/bumpy --trust --engine many --error 0.05 --out $$out/out \
		> $$out/said 2>&1 || { echo "not compiled beforehand, so the first run will be slower:" >&2; \
		tail -1 $$out/said >&2; }; rm -rf $$out
	@touch $(READY)

# The newest versions that pyproject.toml allows, for every Python and system that it allows, with their hashes.
lock:
	@$(PYTHON) -m venv .venv-lock
	@.venv-lock/bin/python -m pip install --quiet --disable-pip-version-check uv
	@.venv-lock/bin/uv --no-config pip compile --quiet --upgrade --universal --python-version 3.11 --extra dev \
		--generate-hashes --custom-compile-command "make lock" --output-file requirements.lock pyproject.toml

demo: setup
	@$(BIN)/rgbn demo

# Example reports: docs/gallery.md, with the reports in docs/_gallery, from where `make docs` takes them.
gallery: setup
	@$(PYTHON) rgbn/system_libraries.py --browser
	$(BIN)/python -m docs.write_gallery

# The site: docs/_build/html/index.html. The pages that the code writes are written first.
docs: setup
	$(BIN)/python -m docs.write_reference
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

# Figures of every step, into out/gates.json; what is measured already, at the same commit, is kept.
gates: setup
	$(BIN)/python -m benchmarks.gates out/gates.json

# What moved by more than its own noise: make gates-compare OLD=old.json NEW=out/gates.json
gates-compare: setup
	@$(BIN)/python -m benchmarks.gates $(OLD) $(NEW)

test: setup
	@$(PYTHON) rgbn/system_libraries.py --browser
	$(TEST) -m "not full"

# As well as what would make `make test` longer; in one run, which makes what tests share once.
test-all: setup
	@$(PYTHON) rgbn/system_libraries.py --browser
	$(TEST)

test-full: setup
	$(TEST) -m full

# Weekly: the tests of `make test` with the newest versions that pyproject.toml allows. Where they pass, `make lock`.
test-latest: BIN := .venv-latest/bin
test-latest:
	@$(PYTHON) rgbn/system_libraries.py --browser
	@$(PYTHON) -m venv --clear .venv-latest
	@$(PIP) --editable '.[dev]'
	$(TEST) -m "not full"

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --threads 2

check: lint test

clean:
	rm -rf .venv .venv-lock .venv-latest out

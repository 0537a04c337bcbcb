# `make run` does everything on a fresh Linux machine with Python 3.11; `make test` is what CI runs;
# `make docs` builds the site in docs/_build/html, checks its links, and runs the code of all pages and docstrings;
# `make bench` measures speed compared with peers; `make fuzz` loads 200,000 damaged files; `make combinations` drives
# every rule x architecture x protection x record; `make release-check` builds wheel and source distribution, and
# installs and uses them with every extra and with other Pythons, in about 15 minutes. After a change of constraints.txt,
# `make hashes` writes requirements-hashed.txt, and `make licences` docs/licences.md.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: run test lint docs bench combinations fuzz release-check hashes licences

run: $(INSTALLED)
	$(BIN)/python -m experiments corral

test: $(INSTALLED) lint
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

docs: $(INSTALLED)
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q tests/test_site.py tests/test_readme.py

bench: $(INSTALLED)
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.memory

combinations: $(INSTALLED)
	$(BIN)/python tests/experiments/combinations.py

fuzz: $(INSTALLED)
	$(BIN)/python tests/helpers/mutants.py --count 200000

release-check: $(INSTALLED)
	PYTHONPATH=tests/helpers $(BIN)/python tests/packaging/release_check.py

hashes: $(INSTALLED)
	PYTHONPATH=tests/helpers $(BIN)/python tests/packaging/hashes.py

licences: $(INSTALLED)
	PYTHONPATH=tests/helpers $(BIN)/python tests/packaging/licences.py

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/codespell
	$(BIN)/lint-imports --no-cache

$(INSTALLED): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[dev]"
	touch $@

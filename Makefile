# One word for each thing people do here. Everything runs in .venv, made on first use.
PYTHON ?= python3
BIN := .venv/bin
DAY ?= 2013-03-08

.PHONY: demo test check proto clean

demo: .venv/.demo  ## replay a real day of flights through a real server and verify every minute
	$(BIN)/dynhull demo --day $(DAY)

test: .venv/.test  ## the whole test suite, on both cores
	$(BIN)/pytest -n 2 --dist worksteal

check: .venv/.check  ## format, lint, types, import rules, proto rules
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/buf lint
	$(BIN)/buf format --diff --exit-code
	$(BIN)/python proto/generate.py --check

proto: .venv/.check  ## regenerate proto/dynhull_proto from proto/dynhull
	$(BIN)/python proto/generate.py

.venv/.%: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --editable '.[$*]'
	touch $@

clean:
	rm -rf .venv build dist

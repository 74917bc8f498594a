# One word for each thing people do here. Everything runs in .venv, made on first use.
PYTHON ?= python3
BIN := .venv/bin
KERNEL := $(shell find dynhull/kernel -name "*.?pp")
DAY ?= 2013-03-08

.PHONY: demo test check docs stub proto contract fuzz fuzz-reference fuzz-server robustness simulate clean

demo: .venv/.demo  ## replay a real day of flights through a real server and verify every minute
	$(BIN)/dynhull demo --day $(DAY)

test: .venv/.test tests/strangers/node_modules  ## the whole test suite, on both cores
	$(BIN)/pytest -n 2 --dist worksteal

FUZZ := $(CXX) -std=c++20 -O1 -g -ffp-contract=off -fsanitize=address,undefined -fno-sanitize-recover=undefined \
	-DDYNHULL_FAIL_ALLOCATIONS
SECONDS ?= 60
OPERATIONS ?= 1000000

fuzz: fuzz-reference  ## random lives: OPERATIONS of the reference; of the kernel, under sanitizers, SECONDS a leaf size
	mkdir -p build
	for leaf in 4 62; do \
		$(FUZZ) -DDYNHULL_LEAF=$$leaf tests/kernel/fuzz.cpp -o build/fuzz$$leaf \
		&& build/fuzz$$leaf $$(cat tests/kernel/seeds.txt) && build/fuzz$$leaf --seconds $(SECONDS) || exit 1; \
	done

fuzz-reference: .venv/.test-core  ## every operation checked against a model; a failure says the seed that repeats it
	$(BIN)/python tests/lives.py --operations $(OPERATIONS)

check: docs  ## format, lint, types, import rules, proto rules, documentation, deploy/
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/clang-format --dry-run --Werror $(KERNEL) tests/kernel/fuzz.cpp tests/kernel/fuzz_static.cpp
	$(BIN)/mypy
	$(STUB) -o build/_kernel.pyi
	diff build/_kernel.pyi dynhull/_kernel.pyi || (echo 'run `make stub`'; exit 1)
	$(BIN)/stubtest dynhull._kernel --allowlist dynhull/kernel/python/stubtest.txt
	$(BIN)/lint-imports
	$(BIN)/buf lint
	$(BIN)/buf format --diff --exit-code
	$(BIN)/buf breaking --against proto/contract.binpb
	$(BIN)/python proto/generate.py --check
	$(BIN)/hadolint deploy/Dockerfile
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.compose-spec deploy/compose.yaml

docs: .venv/.check  ## the documentation as a site, build/site/index.html; broken links are errors
	NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true $(BIN)/mkdocs build --strict

STUB = mkdir -p build && $(BIN)/python -m nanobind.stubgen -q -m dynhull._kernel

stub: .venv/.check  ## regenerate dynhull/_kernel.pyi, the types of the kernel
	$(STUB) -o dynhull/_kernel.pyi

proto: .venv/.check  ## regenerate proto/dynhull_proto from proto/dynhull
	$(BIN)/python proto/generate.py

contract: .venv/.check  ## with a release: the contract that later ones must not break
	$(BIN)/buf breaking --against proto/contract.binpb
	$(BIN)/buf build --exclude-source-info --output proto/contract.binpb

fuzz-server: .venv/.test  ## many more bad requests than `make test` sends
	FUZZ_EXAMPLES=20000 $(BIN)/pytest tests/server/test_fuzz.py --timeout 0 --hypothesis-show-statistics

robustness: .venv/.test  ## kill, starve and damage servers, leave calls, flip bits, while models check every promise
	$(BIN)/python tests/robustness/server/torture.py --faults 99
	$(BIN)/python tests/robustness/server/callers.py --calls 10000 --kills 5
	$(BIN)/python tests/robustness/storage/flips.py --flips 20000

SEED ?= 1

simulate: .venv/.test  ## random lives of the server in simulated time, for SECONDS from SEED, while a model checks every promise
	PYTHONPATH=tests $(BIN)/python -m simulation run --seconds $(SECONDS) --seed $(SEED) --keep

tests/strangers/node_modules: tests/strangers/package-lock.json tests/peers.sh
	tests/peers.sh
	touch $@

.venv/.%: pyproject.toml CMakeLists.txt $(KERNEL)
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --editable '.[$*]'
	touch $@

clean:
	rm -rf .venv build dist tests/strangers/node_modules

# One word for each thing people do here. Everything runs in .venv, made on first use from uv.lock.
PYTHON ?= python3
BIN := .venv/bin
KERNEL := $(shell find dynhull/kernel server/dynhull_server/native server/dynhull_server/state/fences/events/format.py -type f)
COMPILER := $(firstword $(shell for each in "$$CXX" c++ g++ clang++; do command -v "$$each"; done; true))
# Certificates of the system: behind a proxy that inspects TLS, pip and uv trust the same.
export UV_SYSTEM_CERTS ?= 1
# Without cached bytecode, each server and command that a test starts compiles 800 modules: three times the CPU time.
unexport PYTHONDONTWRITEBYTECODE
# Threads of OpenBLAS, which numpy starts, turn 25 ms for nothing after each work, and after the start of a process.
export OPENBLAS_THREAD_TIMEOUT ?= 4
# With a compiler, a kernel that does not build is an error; `DYNHULL_REQUIRE_KERNEL=0 make ...` does without.
export DYNHULL_REQUIRE_KERNEL ?= $(if $(COMPILER),1,0)
DAY ?= 2013-03-08
T ?=
# More workers than cores, as many tests wait for processes and clocks; each finds all tests, and starts what its own share.
WORKERS = -n 4 --dist worksteal
# Folders of tests in memory, where there is room: on a disk, tests and their servers wait for thousands of syncs.
MEMORY = $(shell test "$$(df -Pk /dev/shm 2>/dev/null | awk 'NR == 2 {print $$4}')" -gt 4000000 2>/dev/null && echo /dev/shm)
# `make test` counts lines where Python reports them itself (sys.monitoring, 3.12); tracing on 3.11 takes twice as long.
MONITORING = $(shell $(BIN)/python -c 'import sys; print("sysmon" if sys.version_info >= (3, 12) else "")')
COVERAGE_CORE = $(or $(MONITORING),ctrace)
COVERAGE = $(if $(MONITORING),--cov --cov-report=term)

.DEFAULT_GOAL := help
.PHONY: help demo test check format docs pages stub proto surface vendor contract fuzz fuzz-threads fuzz-reference fuzz-server fuzz-gateway workers shards properties slow browser long robustness robustness-cluster torture cluster upgrade ray kafka languages objects simulate mutants coverage ends soak flakes peers hooks lock clean

help:  ## list these words
	@sed -En 's/^([a-z-]+):[^#]*## (.*)/\1\t\2/p' $(MAKEFILE_LIST) | sort | while IFS="$$(printf '\t')" read -r word does; do \
		printf '  %-16s %s\n' "make $$word" "$$does"; done

demo: .venv/.demo  ## replay a real day of flights through a real server and verify every minute
	$(BIN)/dynhull demo --day $(DAY)

test: .venv/.test .venv/.peers  ## run the tests, but for those of `make slow`, on two cores, or those of T, a path: make test T=tests/core
	TMPDIR=$(or $(TMPDIR),$(MEMORY),/tmp) COVERAGE_CORE=$(COVERAGE_CORE) $(BIN)/pytest $(or $(T),$(WORKERS) $(COVERAGE))

FUZZ_THREADS := $(CXX) -std=c++20 -O1 -g -ffp-contract=off -pthread -DDYNHULL_FAIL_ALLOCATIONS
FUZZ := $(FUZZ_THREADS) -fsanitize=address,undefined -fno-sanitize-recover=undefined
SECONDS ?= 60
OPERATIONS ?= 1000000

fuzz: fuzz-reference fuzz-threads  ## random lives: OPERATIONS of the reference; of the kernel, under sanitizers, SECONDS a leaf size
	for leaf in 4 62; do \
		$(FUZZ) -DDYNHULL_LEAF=$$leaf tests/kernel/fuzz.cpp -o build/fuzz$$leaf \
		&& build/fuzz$$leaf $$(cat tests/kernel/seeds.txt) && build/fuzz$$leaf --seconds $(SECONDS) || exit 1; \
		$(FUZZ) -DDYNHULL_HASH_SEED=1 -DDYNHULL_LEAF=$$leaf tests/kernel/fuzz_keyed.cpp -o build/fuzz_keyed$$leaf \
		&& build/fuzz_keyed$$leaf --seconds $(SECONDS) || exit 1; \
	done
	$(FUZZ) -DDYNHULL_LEAF=4 tests/kernel/fuzz_window.cpp -o build/fuzz_window && build/fuzz_window --seconds $(SECONDS)
	$(FUZZ) -DDYNHULL_HASH_SEED=1 -DDYNHULL_LEAF=4 tests/kernel/fuzz_fences.cpp -o build/fuzz_fences \
	&& build/fuzz_fences --seconds $(SECONDS)

fuzz-threads:  ## the kernel's lives with batches of a few rows on several threads, under each of the sanitizers, SECONDS each
	mkdir -p build
	for sanitizers in address,undefined thread; do \
		THREADED="$(FUZZ_THREADS) -fsanitize=$$sanitizers -fno-sanitize-recover=undefined -DDYNHULL_LEAF=4 \
			-DDYNHULL_ROWS_A_THREAD=3"; \
		$$THREADED tests/kernel/fuzz.cpp -o build/fuzz_threads \
		&& build/fuzz_threads $$(cat tests/kernel/seeds.txt) && build/fuzz_threads --seconds $(SECONDS) \
		&& $$THREADED -DDYNHULL_HASH_SEED=1 tests/kernel/fuzz_fences.cpp -o build/fuzz_fence_threads \
		&& build/fuzz_fence_threads --seconds $(SECONDS) || exit 1; \
	done

fuzz-reference: .venv/.test-core  ## every operation checked against a model; a failure says the seed that repeats it
	$(BIN)/python tests/support/lives.py --operations $(OPERATIONS)

properties: .venv/.test  ## other and many more random examples for the tests of properties
	$(BIN)/pytest $(WORKERS) -m hypothesis --hypothesis-profile properties --timeout 0 tests

slow: .venv/.test .venv/.peers  ## what `make test` leaves to this word: short runs of the tortures and the fuzzers, faults that must be found, notebooks, pages in a browser
	TMPDIR=$(or $(TMPDIR),$(MEMORY),/tmp) SLOW_CASES=all BROWSER_CASES=all $(BIN)/pytest $(WORKERS) -m only_with $(or $(T),tests)

browser: .venv/.test .venv/.peers  ## the dashboard's pages in a real Chromium, some of which `make test` opens
	TMPDIR=$(or $(TMPDIR),$(MEMORY),/tmp) BROWSER_CASES=all $(BIN)/pytest tests/dashboard tests/gateway/test_past_holes.py -n 2 --dist loadfile

long: .venv/.test  ## all cases of the tests of which `make test` runs every third to seventh
	LONG_CASES=all $(BIN)/pytest $(WORKERS) -m "every or only_with" tests

coverage: .venv/.test .venv/.peers  ## run all tests and print the share of lines that they run, server processes included
	COVERAGE_CORE=$(COVERAGE_CORE) $(BIN)/pytest $(WORKERS) --cov --cov-report=term

format: .venv/.check  ## format the Python, C++ and proto files
	$(BIN)/ruff check --select I --fix .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(filter %.cpp %.hpp,$(KERNEL)) tests/kernel/*.cpp
	$(BIN)/buf format --write

check: pages  ## format, lint, types, import rules, proto rules, documentation, deploy/
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/clang-format --dry-run --Werror $(filter %.cpp %.hpp,$(KERNEL)) $(wildcard tests/kernel/*.cpp tests/kernel/*.hpp)
	$(BIN)/mypy
	$(BIN)/mypy tests/surface/typed_program.py
	if [ -x $(TSC) ]; then $(TSC) --project clients/typescript; else echo 'types of clients/typescript not checked: `make peers`'; fi
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(STUB) dynhull._kernel -o build/_kernel.pyi
	$(STUB) dynhull_server._native -o build/_native.pyi
	diff build/_kernel.pyi dynhull/_kernel.pyi && diff build/_native.pyi server/dynhull_server/_native.pyi \
	|| (echo 'run `make stub`'; exit 1)
	$(BIN)/stubtest dynhull._kernel --allowlist dynhull/kernel/python/stubtest.txt
	$(BIN)/lint-imports
	$(BIN)/buf lint
	$(BIN)/buf format --diff --exit-code
	$(BIN)/buf breaking --against proto/contract.binpb
	$(BIN)/python proto/generate.py --check
	$(BIN)/hadolint deploy/Dockerfile
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.dependabot .github/dependabot.yml
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/[!c]*.yml
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.citation-file-format CITATION.cff
	$(BIN)/zizmor --quiet --offline .github
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.compose-spec deploy/compose.yaml
	$(BIN)/kubernetes-validate --quiet --strict deploy/kubernetes/*.yaml

docs: .venv/.check  ## the documentation as a site, build/site/index.html; broken links are errors
	NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true $(BIN)/mkdocs build --strict

pages: docs  ## what the pages of the site show is so: programs and commands as readers copy them, links, the reference
	SITE_CASES=all $(BIN)/pytest -n 2 --dist loadfile -m only_with tests/docs

TSC = clients/typescript/node_modules/.bin/tsc
STUB = mkdir -p build && $(BIN)/python -m nanobind.stubgen -q -m

stub: .venv/.check  ## regenerate the types of what is in C++: dynhull/_kernel.pyi, server/dynhull_server/_native.pyi
	$(STUB) dynhull._kernel -o dynhull/_kernel.pyi
	$(STUB) dynhull_server._native -o server/dynhull_server/_native.pyi

proto: .venv/.check  ## regenerate proto/dynhull_proto from proto/dynhull
	$(BIN)/python proto/generate.py

surface: .venv/.test  ## what users see of HTTP, commands and the SDK is to change: writes tests/surface/goldens anew
	SURFACE=renew $(BIN)/pytest -q tests/surface/test_goldens.py

vendor:  ## bring newer libraries and maps into the dashboard's page, from npm
	npm ci --prefix clients/gateway --no-audit --no-fund --ignore-scripts
	$(PYTHON) clients/gateway/vendor.py

contract: .venv/.check  ## with a release: the contract that later ones must not break
	$(BIN)/buf breaking --against proto/contract.binpb
	$(BIN)/buf build --exclude-source-info --output proto/contract.binpb

workers: .venv/.test  ## the tests of server, client, command line and dashboard, run against two gateways and two workers
	BROWSER_CASES=all $(BIN)/pytest tests/server tests/cluster tests/client tests/cli tests/dashboard --shape workers -n 2

SHARDED = stream watch entities windows verification resume query deadlines queries

shards: .venv/.test  ## tests of the server whose promises a hull over shards keeps, run on such hulls
	$(BIN)/pytest $(SHARDED:%=tests/server/*/test_%.py) --shape shards -n 2

fuzz-server: .venv/.test  ## many more bad requests than `make test` sends
	FUZZ_EXAMPLES=20000 $(BIN)/pytest tests/server/writes/test_fuzz.py --timeout 0 --hypothesis-show-statistics

fuzz-gateway: .venv/.test  ## many more bad HTTP requests than `make test` sends
	FUZZ_EXAMPLES=200 $(BIN)/pytest tests/gateway/test_schema.py --timeout 0

robustness: .venv/.test  ## kill, starve and damage servers, set clocks back, leave calls, flip bits, while models check every promise
	$(BIN)/python tests/robustness/server/torture.py --faults 100
	$(BIN)/python tests/robustness/server/torture.py --faults 100 --workers
	$(BIN)/python tests/robustness/server/callers.py --calls 10000 --kills 5
	$(BIN)/python tests/robustness/server/deaf.py --callers 200
	$(BIN)/python tests/robustness/storage/flips.py --flips 20000
	$(BIN)/python tests/robustness/storage/segment_flips.py --flips 10000
	$(BIN)/python tests/robustness/alarms/alarm_rationals.py --batches 100000
	$(BIN)/python tests/robustness/fences/fence_torture.py --steps 1000000
	$(BIN)/python tests/robustness/fences/kill_torture.py --steps 1000000 --kills 1000
	$(BIN)/python tests/robustness/bridges/relay_torture.py --kills 100
	$(BIN)/python tests/robustness/bridges/alarm_torture.py --faults 300
	$(BIN)/python tests/robustness/bridges/ingest_torture.py --kills 50
	$(BIN)/python tests/robustness/bridges/ingest_torture.py --kills 20 --only broker
	$(BIN)/python tests/robustness/bridges/mqtt_torture.py --kills 20

SCHEDULES ?= 100000

robustness-cluster: .venv/.test  ## SCHEDULES of one hull over shards: lost messages, killed roots and shards, and the faults that they must find; faults of PostgreSQL under a server
	PYTHONPATH=tests $(BIN)/python -m shards.simulation --schedules $(SCHEDULES)
	PYTHONPATH=tests $(BIN)/python -m shards.mutants
	$(BIN)/python tests/robustness/cluster/postgres_torture.py --faults 100
	$(BIN)/python tests/robustness/cluster/postgres_torture.py --faults 100 --workers
	$(BIN)/python tests/robustness/cluster/machines_torture.py --faults 100
	$(BIN)/python tests/robustness/cluster/planned.py --changes 300
	$(BIN)/python tests/robustness/bridges/alarm_torture.py --faults 300 --moves

FAULTS ?= 25

torture: .venv/.test .venv/.peers  ## FAULTS from SEED for each kind of server: one process, several workers, PostgreSQL, a cluster; appended to build/torture, whose sums are printed
	$(BIN)/python tests/robustness/server/torture.py --faults $(FAULTS) --seed $(SEED) --record
	$(BIN)/python tests/robustness/server/torture.py --faults $(FAULTS) --seed $(SEED) --record --workers
	$(BIN)/python tests/robustness/cluster/postgres_torture.py --faults $(FAULTS) --seed $(SEED) --record
	$(BIN)/python tests/robustness/cluster/postgres_torture.py --faults $(FAULTS) --seed $(SEED) --record --workers
	$(BIN)/python tests/robustness/cluster/machines_torture.py --faults $(FAULTS) --seed $(SEED) --record
	$(BIN)/python tests/robustness/server/record.py

cluster: .venv/.test  ## all tests of several processes and machines; `make test` runs the cheaper ones
	CLUSTER_CASES=all SLOW_CASES=all $(BIN)/pytest tests/cluster tests/robustness/cluster -n 4

BASE ?= HEAD~
CONTRACT = tests/client

upgrade: .venv/.test  ## from BASE, an earlier commit: a cluster is upgraded beside callers, and the tests of the client run across the two versions
	$(BIN)/python tests/robustness/cluster/earlier.py $(BASE) -- $(CONTRACT)

ray: .venv/.test .venv/.peers  ## all tests of Ray: Datasets, and as a launcher of servers, with a torture
	RAY_CASES=all $(BIN)/pytest tests/ray
	$(BIN)/python tests/robustness/cluster/ray_torture.py --faults 11

ends: .venv/.test  ## whatever waits in the SDK is cancelled and closed after each of 41 steps beside servers that have failed: how long it takes
	CLIENT_CASES=all $(BIN)/pytest tests/client/test_ends.py -s

build/kafka/.jars: tests/bridges/kafka/pom.xml
	mvn -q -B -f $< dependency:copy-dependencies -DincludeScope=runtime -DoutputDirectory=$(CURDIR)/build/kafka
	touch $@

objects: .venv/.test  ## servers that keep the past of hulls in an object store, which fails, hangs and answers in halves
	OBJECTS_CASES=all $(BIN)/pytest tests/storage/test_objects.py tests/server/lives/test_object_store.py

build/openapi/.tools: tests/docs/openapi/package-lock.json tests/docs/openapi/pom.xml
	mkdir -p $(@D)
	cp tests/docs/openapi/package*.json $(@D)
	npm ci --prefix $(@D) --no-audit --no-fund --ignore-scripts --loglevel=error || echo 'openapi-typescript and redocly are not tried: no npm'
	mvn -q -B -f tests/docs/openapi/pom.xml dependency:copy-dependencies -DincludeScope=runtime -DoutputDirectory=$(CURDIR)/$(@D) \
	|| echo 'openapi-generator is not tried: no Maven'
	touch $@

languages: .venv/.test build/openapi/.tools  ## the programs in Go, Java and Rust on their pages, each where its tools are: built, and run beside a server that is killed; what programs make of the gateway's description
	PATH="$(CURDIR)/$(BIN):$$PATH" LANGUAGES_CASES=all $(BIN)/pytest tests/docs/test_languages.py tests/docs/test_openapi.py tests/typescript/test_package.py::test_points_beside_edges

kafka: .venv/.test build/kafka/.jars  ## an ingest from a real Kafka, and a relay to one that is killed, which Maven brings (Debian: maven, default-jre-headless)
	KAFKA_CASES=all $(BIN)/pytest tests/bridges/test_kafka.py tests/bridges/test_kafka_target.py

soak: fuzz fuzz-server fuzz-gateway properties long robustness robustness-cluster workers shards cluster ray objects ends simulate  ## all that takes too long for every run, for hours; `make slow` has a short run of each
	PYTHONPATH=tests $(BIN)/python -m simulation mutants
	$(BIN)/python tests/mutants/named.py

N ?= 20
BUSY ?= 0

flakes: .venv/.test .venv/.peers  ## the suite N times in random order, beside BUSY busy processes: which tests fail, and how often
	$(BIN)/python tests/flakes.py --runs $(N) --busy $(BUSY) --seed $(SEED) -- $(WORKERS)

SEED ?= 1
MUTANTS ?= 200

mutants: $(BIN)/uv  ## put MUTANTS small faults into the reference geometry, one by one, and count those that the tests find
	UV_PROJECT_ENVIRONMENT=build/mutants/.venv $(BIN)/uv sync --quiet --locked --no-install-project --only-group mutants
	build/mutants/.venv/bin/python tests/mutants/run.py --mutants $(MUTANTS) --seed $(SEED)

simulate: .venv/.test  ## random lives of the server in simulated time, for SECONDS from SEED, while a model checks every promise
	PYTHONPATH=tests $(BIN)/python -m simulation run --seconds $(SECONDS) --seed $(SEED) --keep

.venv/.peers: tests/javascript/package-lock.json clients/typescript/package-lock.json tests/peers.sh
	mkdir -p .venv
	tests/peers.sh
	touch $@

peers:  ## install the programs that some tests talk to: a browser, Prometheus, Node.js (as root on Debian)
	tests/peers.sh

hooks: .venv/.check  ## check the files of every commit before it is made (pre-commit)
	$(BIN)/pre-commit install

lock: $(BIN)/uv  ## update uv.lock after a change of dependencies in pyproject.toml
	$(BIN)/uv lock

$(BIN)/uv:
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet 'uv>=0.13'

.venv/.%: pyproject.toml uv.lock CMakeLists.txt $(KERNEL) | $(BIN)/uv
	$(BIN)/uv sync --quiet --locked --inexact --extra $*
	touch $@

clean:  ## remove everything that these words made
	rm -rf .venv build dist tests/javascript/node_modules clients/typescript/node_modules clients/typescript/types

# Every target sets up what it needs: a virtual environment inside the checkout, no root.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
BENCH  := .venv-bench
ORACLE := .venv-oracle
LONG   := $(shell cat tests/long.txt)

# The tests start hundreds of programs, which share the compiled modules.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: house mistakes lively controllers soak-robots soak-signals soak-days soak-suspensions soak-hosts help demo test test-long test-engines test-all check types limits conformance oracle-trees sweep-pddl soak kill-kb kill-runs soak-kb memory sweep-files fuzz lower-bounds corrupt-stores mutation
.PHONY: bench-startup bench-broken bench-editor bench-calls bench-engine bench-planning bench-kb bench-viewer bench-run bench-choice bench-learned-costs bench-transforms bench-standstill bench-wire test-wire pictures viewer lock-viewer test-viewer screenshots docs clean

help:   ## this list
	@grep -E '^[a-z-]+: .*##|^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/'

$(VENV)/.run: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.test: $(VENV)/.run
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,check]'
	@touch $@

$(BENCH)/.peers: pyproject.toml   # apart, so that what the peers pin does not disturb ours
	$(PYTHON) -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

demo: $(VENV)/.run   ## clear a table: designed where foreseen, planned where not
	$(BIN)/dsc run clean-up-table --seed 1 --faults 0.2

test: $(VENV)/.test check   ## static checks, then the tests, on all cores; those of tests/long.txt have their own target
	$(BIN)/python -m pytest -n auto $(LONG:%=--ignore=%)

test-long: $(VENV)/.test   ## whole runs of robots and programs: the files whose tests take more than five seconds (tests/long.txt)
	$(BIN)/python -m pytest -n auto $(LONG)

$(VENV)/.engines: $(VENV)/.test   # planning engines that no one is forced to have; ENHSP needs Java besides
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,check,fast,numeric,durations,numbers]'
	@command -v java >/dev/null || $(if $(filter 0,$(shell id -u)),,sudo) apt-get install --yes --quiet default-jre-headless
	@touch $@

mistakes: $(VENV)/.test   ## planted mistakes of users, and the answers of the command
	$(BIN)/python tests/mistakes/answer_mistakes.py

test-engines: $(VENV)/.engines   ## every planning engine for real
	$(BIN)/dsc doctor
	$(BIN)/python -m pytest -rs tests/planning/engines/test_real_engines.py tests/planning/engines/test_kairos.py

test-all: $(VENV)/.engines check   ## all tests, with every planning engine and the page in a browser
	$(BIN)/dsc doctor
	$(BIN)/python -m pytest -n auto -rs
	frontend/tests.sh

check: $(VENV)/.test   ## ruff, mypy strict, import contracts, prose, limits of the house
	$(MAKE) --no-print-directory --jobs=2 --output-sync=target types limits

types: $(VENV)/.test
	$(BIN)/mypy
	$(BIN)/mypy --config-file tests/mypy.toml tests

limits: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/lint-imports --no-cache
	$(BIN)/python tests/prose.py
	$(BIN)/python tests/house.py

house: $(VENV)/.test   ## sizes, imports, names and circles of the code, with their limits in tests/house.toml (NAMES=1 prints the names)
	$(BIN)/python tests/house.py $(if $(NAMES),--names)

conformance: $(VENV)/.test   ## the SCXML charts of SCION and of the W3C, fetched with npm into .conformance/, on this engine (WRITE=1 writes the docs)
	$(BIN)/python tests/conformance/charts.py $(if $(WRITE),--write)

$(ORACLE)/.trees:   # BehaviorTree.CPP 4.8.2 as a wheel
	$(PYTHON) -m venv $(ORACLE)
	$(ORACLE)/bin/python -m pip install --quiet --disable-pip-version-check behaviortreepy==0.1.4
	@touch $@

oracle-trees: $(ORACLE)/.trees   ## record the results of BehaviorTree.CPP, with which `make test` compares behaviour trees
	$(ORACLE)/bin/python tests/conformance/record_trees.py

sweep-pddl: $(VENV)/.engines   ## the PDDL files that come with unified-planning: read, planned for, plans checked by their validator (WRITE=1 writes the docs)
	$(BIN)/python -W ignore tests/conformance/pddl_sweep.py $(if $(WRITE),--write)

sweep-files: $(VENV)/.test   ## every command with every kind of file that it is not meant for: no traceback, no wait
	SWEEP=1 $(BIN)/python -m pytest tests/test_command.py -k kind_of_file

soak: $(VENV)/.run   ## simulated runs of the clean-up table with faults and crashes: does every promise hold? (RUNS=N FIRST=SEED FAULTS=P)
	$(BIN)/python benchmarks/soak.py --runs $(or $(RUNS),1000) --first $(or $(FIRST),0) --faults $(or $(FAULTS),0.1)

soak-robots: $(VENV)/.test   ## random small robots with faults, changes by others, priorities and kills: is every promise kept? (RUNS=N FIRST=SEED)
	$(BIN)/python tests/support/random_robots.py --runs $(or $(RUNS),2000) --first $(or $(FIRST),0)

controllers: $(VENV)/.test   ## random charts: do the engine, a generated Python module and a generated C file agree, call by call? (CHARTS=N FIRST=SEED PLAYS=N SECONDS=N)
	$(BIN)/python tests/support/controllers_soak.py --charts $(or $(CHARTS),200) --first $(or $(FIRST),0) --plays $(or $(PLAYS),4) $(if $(SECONDS),--seconds $(SECONDS))

soak-signals: $(VENV)/.test   ## signals at random moments of real runs with a device: is it braked, closed one time, and the run resumed? (RUNS=N FIRST=SEED)
	$(BIN)/python tests/support/signals_soak.py $(or $(RUNS),25) $(or $(FIRST),0)

soak-days: $(VENV)/.test   ## a robot with a store serves a goal a minute for simulated days: memory, file and time of each goal (DAYS=N KEEP=RUNS SEED=N)
	$(BIN)/python tests/support/days_soak.py --days $(or $(DAYS),3) --keep $(or $(KEEP),200) --seed $(or $(SEED),0)

soak-suspensions: $(VENV)/.test   ## runs suspended at random moments and resumed: is each action executed once? (CYCLES=N SEED=N)
	$(BIN)/python tests/support/days_soak.py --suspensions $(or $(CYCLES),1000) --seed $(or $(SEED),0)

lively: $(VENV)/.test   ## robots in a world that changes every half second: is each needed step carried out once? (HOURS=H SEED=N)
	$(BIN)/python tests/support/lively_world.py --hours $(or $(HOURS),1) --seed $(or $(SEED),0)

soak-hosts: $(VENV)/.test   ## hosts of two robots and a device killed and stopped at random moments, and runs resumed: is nothing moved twice? (CYCLES=N)
	CYCLES=$(or $(CYCLES),50) $(BIN)/python -m pytest -n 4 tests/planning/cli/test_host.py -k "twice or kept"

test-wire: $(VENV)/.test   ## the whole suite of a transport over Zenoh, also over a bad network, in real time
	WIRE=1 $(BIN)/python -m pytest -n 4 tests/dsc/wire/test_zenoh.py

test-deadlines: $(VENV)/.test   ## random sets of real-time tasks: do the tests of deadlines agree with simulated schedules? (SETS=N)
	SETS=$(or $(SETS),10000) $(BIN)/python -m pytest tests/dsc/deployment/test_schedulability.py

kill-kb: $(VENV)/.test   ## kill -9 a process that writes a store, for each durability: is all that it acknowledged there? (KILLS=N)
	KILLS=$(or $(KILLS),100) $(BIN)/python -m pytest tests/knowledge_base/journal/test_kb_kill.py

kill-runs: $(VENV)/.test   ## kill -9 runs of the clean-up table and resume them: do they end like runs never killed? (KILLS=N)
	KILLS=$(or $(KILLS),50) $(BIN)/python -m pytest tests/domains/test_kill_runs.py

soak-kb: $(VENV)/.test   ## four threads and an event loop change, ask and watch one knowledge base at once (SECONDS=N)
	$(BIN)/python tests/support/kb_soak.py $(or $(SECONDS),30)

memory: $(VENV)/.run   ## a run of 24 simulated hours and 1,000,000 events: is its memory flat after the first tenth? (EVENTS=N)
	$(BIN)/python benchmarks/memory.py $(if $(EVENTS),--events $(EVENTS))

LOWER := .venv-lower

$(LOWER)/.made: pyproject.toml tests/dependencies.py   # the core and what its tests need, each at its lower bound
	$(PYTHON) -m venv $(LOWER)
	$(PYTHON) tests/dependencies.py --lower > $(LOWER)/bounds.txt
	$(LOWER)/bin/python -m pip install --quiet --disable-pip-version-check --constraint $(LOWER)/bounds.txt --editable '.[test]'
	@touch $@

lower-bounds: $(LOWER)/.made   ## tests of every room with the oldest packages that pyproject.toml allows
	$(LOWER)/bin/dsc run clean-up-table --json
	$(LOWER)/bin/python -m pytest -W ignore::DeprecationWarning -p no:cacheprovider tests/test_command.py \
		tests/knowledge_base/test_kb_store.py tests/knowledge_base/drawing/test_kb_drawing.py tests/knowledge_base/cli/test_kb_cli.py \
		tests/dsc/text/test_yaml_plots.py tests/dsc/model/test_model.py tests/dsc/text/test_plot_schema.py tests/dsc/cli/test_plot_cli.py \
		tests/dsc/drawing/test_diagram.py tests/dsc/runs/test_run_store.py tests/dsc/viewer/test_viewer_server.py \
		tests/planning/engines/test_planner.py tests/planning/engines/test_unified.py tests/planning/cli/test_cli.py

fuzz: $(VENV)/.test   ## mutated inputs for every reader and command: no traceback, no hang, no growth (SECONDS=N SEED=N ONLY=NAMES REPRODUCE=FILE)
	$(BIN)/python tests/fuzz/fuzz.py --seconds $(or $(SECONDS),60) --seed $(or $(SEED),0) $(if $(ONLY),--only $(ONLY)) $(if $(REPRODUCE),--reproduce $(REPRODUCE))

MUTATION := .venv-mutation

$(MUTATION)/.made: pyproject.toml   # apart, since mutmut brings much along
	$(PYTHON) -m venv $(MUTATION)
	$(MUTATION)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[mutation]'
	@touch $@

mutation: $(MUTATION)/.made   ## change one thing at a time: do the tests of the room notice? (ROOM=NAMES SAMPLE=N SEED=N JOBS=N)
	$(MUTATION)/bin/python tests/mutation/mutation.py $(ROOM) $(if $(SAMPLE),--sample $(SAMPLE)) $(if $(SEED),--seed $(SEED)) $(if $(JOBS),--jobs $(JOBS))

corrupt-stores: $(VENV)/.test   ## stores damaged in every way: does any reader answer what never was? (CORRUPTIONS=N FIRST=SEED)
	$(BIN)/python tests/support/stores_soak.py $(or $(CORRUPTIONS),1000) $(or $(FIRST),0)

bench-startup: $(VENV)/.run   ## what `dsc --help` costs, as a ratio to a bare interpreter
	$(BIN)/python benchmarks/startup.py

bench-editor: $(VENV)/.run   ## the time from an edit of a plot with 1,000 lines to its diagnostics
	$(BIN)/python benchmarks/editor.py

bench-broken: $(VENV)/.run   ## how long the error in a broken plot takes, median and longest (RUNS=N)
	$(BIN)/python benchmarks/broken_plots.py --runs $(or $(RUNS),3)

bench-calls: $(VENV)/.run   ## Python calls, hops between files, and files on five main paths (WRITE=1 writes docs and counts)
	$(BIN)/python benchmarks/calls.py $(if $(WRITE),--write)

bench-engine: $(BENCH)/.peers   ## what an event costs: a table by hand, this engine, four peers (WRITE=1 writes the docs)
	$(BENCH)/bin/python benchmarks/engine.py $(if $(WRITE),--write)

bench-planning: $(VENV)/.engines   ## tables of 5 to 50 items: each engine alone, the race, and the parts (QUICK=1, WRITE=1 writes the docs)
	$(BIN)/python benchmarks/planners.py $(if $(QUICK),--quick) $(if $(WRITE),--write)

bench-standstill: $(VENV)/.run   ## how long a program's event loop stands still at most while a robot of 60 to 360 steps runs
	$(BIN)/python benchmarks/standstill.py

bench-kb: $(BENCH)/.peers   ## what facts, questions, updates and conditions cost: an index by hand, this knowledge base, four peers (WRITE=1 writes the docs)
	$(BENCH)/bin/python benchmarks/kb.py $(if $(WRITE),--write)

bench-wire: $(VENV)/.test   ## a call in a process and over Zenoh, and Zenoh alone; times until a death is noticed (QUICK=1, WRITE=1 writes the docs)
	$(BIN)/python benchmarks/wire.py $(if $(QUICK),--quick) $(if $(WRITE),--write)

bench-run: $(VENV)/.run   ## a macrostep without a store and with one, and 1,000 plots at once, as ratios (QUICK=1, PLOTS=N, SECONDS=N, WRITE=1 writes the docs)
	$(BIN)/python benchmarks/run.py $(if $(QUICK),--quick) $(if $(PLOTS),--plots $(PLOTS)) $(if $(SECONDS),--seconds $(SECONDS)) $(if $(WRITE),--write)

bench-choice: $(VENV)/.run   ## candidates chosen by order, by priority, learned and by an oracle: time and slips (RUNS=N)
	$(BIN)/python benchmarks/choice.py --runs $(or $(RUNS),200)

bench-learned-costs: $(VENV)/.engines   ## plans of the clean-up table by experience: falls, trips and simulated time (RUNS=N LEARNED=N ITEMS=N)
	$(BIN)/python benchmarks/learned_costs.py --runs $(or $(RUNS),40) --learned $(or $(LEARNED),20) --items $(or $(ITEMS),32)

bench-transforms: $(VENV)/.run   ## 10,000 random trees of frames compared with scipy; the cost of updates and look-ups (TREES=N)
	$(BIN)/python benchmarks/transforms.py --trees $(or $(TREES),10000)

pictures: $(VENV)/.run   ## draw the pictures that README and docs show
	$(BIN)/dsc plot show domains/clean_up_table/plots/clean_up_table.yaml --svg docs/pictures/clean_up_table.svg
	$(BIN)/dsc plot show domains/clean_up_table/plots/search.yaml --svg docs/pictures/search.svg
	$(BIN)/dsc plot show planning/plots/achieve.yaml --svg docs/pictures/achieve.svg
	$(BIN)/dsc plot show docs/plots/life_cycle.yaml --svg docs/pictures/life_cycle.svg
	$(BIN)/dsc plot show domains/elevator/plots/take_elevator.yaml --svg docs/pictures/take_elevator.svg
	$(BIN)/dsc deployment draw examples/strangers/lab.yaml --svg docs/pictures/deployment.svg
	$(BIN)/dsc deployment draw examples/strangers/lab.yaml --timeline --svg docs/pictures/worst_cases.svg
	$(BIN)/dsc kb draw examples/kitchen/problem.pddl --to docs/pictures/kitchen.svg
	$(BIN)/python examples/working_memory.py docs/pictures/working_memory.svg

NODE_MODULES := frontend/node_modules/.made

$(NODE_MODULES): frontend/package-lock.json   # Node is needed to build the page, never to show it
	cd frontend && npm ci --no-fund --no-audit
	@touch $@

lock-viewer:   ## the page's lock after a change of frontend/package.json: versions and digests, and no registry's name
	cd frontend && npm install --package-lock-only --omit-lockfile-registry-resolved --no-audit
	sed -i '/"funding": {/,/},\?$$/d' frontend/package-lock.json

viewer: $(NODE_MODULES)   ## build the page that `dsc view` shows (needs Node and npm)
	cd frontend && npm run --silent build

test-viewer: $(VENV)/.test   ## the page's own tests, then the page in Debian's Chromium (installed as root; skipped without)
	frontend/tests.sh

screenshots: $(VENV)/.test $(NODE_MODULES)   ## the pictures of the page that the docs show (needs Chromium)
	cd frontend && node screenshots.mjs

bench-viewer: $(VENV)/.test $(NODE_MODULES)   ## what the page weighs, what watching costs a run, 100,000 records opened and scrubbed (RUNS=N rounds)
	$(BIN)/python benchmarks/viewer.py $(if $(RUNS),--rounds $(RUNS))

SITE := .venv-docs

$(SITE)/.made: pyproject.toml   # apart, since the site needs none of the tests' packages
	$(PYTHON) -m venv $(SITE)
	$(SITE)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

docs: $(SITE)/.made   ## build the pages and the reference as a site into site/; each warning and broken link is an error
	NO_MKDOCS_2_WARNING=1 $(SITE)/bin/mkdocs build --strict

clean:   ## forget the environment and caches
	rm -rf $(VENV) $(BENCH) $(ORACLE) $(LOWER) $(MUTATION) $(SITE) site .mutation frontend/node_modules .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

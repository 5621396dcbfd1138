# Every target sets itself up on a fresh machine with Python 3.11+ (with venv), make and git.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

# Without their byte code on the disk, processes take half a second longer to start, and tests start many.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: mission test quick check stability bench wheel sbom audit docker-build docker-test clean

# The lock file pins what was tested, by version and hash. pip takes no hashes where it installs a folder, so what is
# installed with this one has the versions alone.
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check
PINNED := $(INSTALL) --constraint $(VENV)/versions.txt --editable
$(VENV)/.installed: pyproject.toml deploy/requirements.lock
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(INSTALL) --require-hashes --requirement deploy/requirements.lock
	sed -n 's/^\([^ ]*==[^ ]*\).*/\1/p' deploy/requirements.lock > $(VENV)/versions.txt
	$(PINNED) ".[dev]"
	touch $@

mission: $(VENV)/.installed
	$(BIN)/lapwing run lapwing/scenes/delivery_mission.toml

# Ground stations and ROS 2 nodes that the tests fly with; where they cannot be had, those tests say so and are skipped.
# zenoh-ros2-sdk has a folder to itself: it brings a package `messages`, which would stand before ours.
$(VENV)/.clients: $(VENV)/.installed
	-$(PINNED) ".[clients]"
	-$(INSTALL) --no-deps --target $(VENV)/ros2-sdk "zenoh-ros2-sdk>=0.1.8"
	touch $@

# Two workers more than cores: tests wait for a third of their time; those of `quick` for less.
CORES := $(shell getconf _NPROCESSORS_ONLN)
WORKERS ?= $(shell expr $(CORES) + 2)
PYTEST = $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder --durations 20 --durations-min 1

test: $(VENV)/.clients
	$(PYTEST)

# What a change most likely breaks: all but the tests that are marked long.
quick: WORKERS = $(shell expr $(CORES) + 1)
quick: $(VENV)/.installed
	$(PYTEST) -m "not long"

check: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest tests/contracts/test_imports.py

stability: $(VENV)/.installed
	$(BIN)/lapwing stability

$(VENV)/.bench: $(VENV)/.installed
	$(PINNED) ".[bench]"
	touch $@

bench: $(VENV)/.bench
	$(BIN)/python -m benchmarks

# What images ship, for those who must know: a bill of materials in CycloneDX's form, and the known faults of it (asks a
# database on the network).
SHIPPED := $(filter-out %-tests.lock,$(wildcard deploy/requirements*.lock))
$(VENV)/audit/bin/pip-audit:
	$(PYTHON) -m venv $(VENV)/audit
	$(VENV)/audit/bin/python -m pip install --quiet --disable-pip-version-check "cyclonedx-bom>=7" "pip-audit>=2.9"

sbom: $(VENV)/.installed $(VENV)/audit/bin/pip-audit
	mkdir -p build
	cat $(SHIPPED) | $(VENV)/audit/bin/cyclonedx-py requirements - --pyproject pyproject.toml \
		--output-reproducible --output-format JSON --output-file build/sbom.json

DATABASE := https://api.osv.dev/v1/vulns/OSV-2020-111
audit: $(VENV)/audit/bin/pip-audit
	@$(VENV)/audit/bin/python -c "from urllib.request import urlopen; urlopen('$(DATABASE)', timeout=15)" 2> /dev/null || \
		{ echo "audit: $(DATABASE) gives no answer: known faults cannot be looked up from here" >&2; exit 2; }
	$(VENV)/audit/bin/pip-audit --vulnerability-service osv --strict --require-hashes --disable-pip $(addprefix --requirement ,$(SHIPPED))

# A wheel that has the kernels of a scene with it, for processors like this one's; others compile their own.
SHIPS ?= lapwing/scenes/delivery_mission.toml
wheel: $(VENV)/.installed
	LAPWING_CACHE=lapwing/kernels/shipped $(BIN)/lapwing warm $(SHIPS)
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .
	rm -r build/lib lapwing/kernels/shipped

docker-build:
	PYTHON=$(PYTHON) deploy/build.sh

docker-test: $(VENV)/.installed
	LAPWING=$(BIN)/lapwing PYTHON=$(PYTHON) deploy/docker_test.sh

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache

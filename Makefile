# Every target sets itself up on a fresh machine with Python 3.11+ (with venv), make and git.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: mission test check stability bench docker-build docker-test clean

# The lock file pins what was tested; without it the lower bounds of pyproject.toml hold.
$(VENV)/.installed: pyproject.toml deploy/requirements.lock
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint deploy/requirements.lock --editable ".[dev]"
	touch $@

mission: $(VENV)/.installed
	$(BIN)/lapwing run scenes/delivery_mission.toml

# Ground stations that the tests fly with; where they cannot be had, those tests say so and are skipped.
$(VENV)/.clients: $(VENV)/.installed
	-$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint deploy/requirements.lock --editable ".[clients]"
	touch $@

test: $(VENV)/.clients
	$(BIN)/python -m pytest -n auto --dist loadfile

check: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest tests/contracts/test_imports.py

stability: $(VENV)/.installed
	$(BIN)/lapwing stability

$(VENV)/.bench: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint deploy/requirements.lock --editable ".[bench]"
	touch $@

bench: $(VENV)/.bench
	$(BIN)/python -m benchmarks

docker-build:
	PYTHON=$(PYTHON) deploy/build.sh

docker-test: $(VENV)/.installed
	LAPWING=$(BIN)/lapwing PYTHON=$(PYTHON) deploy/docker_test.sh

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache

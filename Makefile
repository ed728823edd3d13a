# Each target does its own set-up, in .venv.
SHELL := /bin/sh
VENV := .venv
BIN := $(VENV)/bin
# the first interpreter of 3.11 or newer
FIND_PYTHON := for p in python3 python3.13 python3.12 python3.11 python; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then echo $$p; break; fi; done

# what test-wheel and test-lowest build and install
TRY := .try
PYTHON := $(shell $(FIND_PYTHON))

.PHONY: demo test lint docs test-cpu test-cpu-quick test-wheel test-lowest clean

demo: $(VENV)/.installed
	$(BIN)/stablepush demo

# in the order of the folders: by their number of tests, slow files of few tests would come last, one worker waiting
test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# warnings are errors; the pages are in docs/_build
docs: $(VENV)/.installed-docs
	$(BIN)/sphinx-build --quiet --fail-on-warning --builder html docs docs/_build

# what is decided, as on other processors: two of the settings, in less than two minutes
test-cpu-quick: $(VENV)/.installed-test
	$(BIN)/python tests/processors.py --only native old

# the whole suite under every setting, some 8 minutes each; make test-cpu SETTINGS="old portable" for some of them
test-cpu: $(VENV)/.installed-test
	$(BIN)/python tests/processors.py
	$(BIN)/python tests/processors.py --suite $(if $(SETTINGS),--only $(SETTINGS))

# the tests from an installed wheel, built from the sdist, in a folder without the package: make test-wheel PYTHON=python3.12
test-wheel:
	rm -rf $(TRY) && $(PYTHON) -m venv $(TRY)/venv
	$(TRY)/venv/bin/python -m pip install --quiet --disable-pip-version-check build
	$(TRY)/venv/bin/python -m build --outdir $(TRY)/dist .
	$(TRY)/venv/bin/python -m pip install --quiet --disable-pip-version-check "$$(ls $(TRY)/dist/*.whl)[test]"
	$(call tests_of_wheel)

# the same with the lowest versions of all dependencies that pyproject.toml allows; the oldest typer and matplotlib use names that
# the newest click and pyparsing warn of, and the tests take warnings for errors
test-lowest:
	rm -rf $(TRY) && $(PYTHON) -m venv $(TRY)/venv
	$(TRY)/venv/bin/python -m pip install --quiet --disable-pip-version-check build uv
	$(TRY)/venv/bin/python -m build --wheel --outdir $(TRY)/dist .
	printf 'click<8.2\npyparsing<3.2\n' > $(TRY)/constraints.txt
	$(TRY)/venv/bin/uv pip compile --quiet --resolution lowest-direct --extra test --constraint $(TRY)/constraints.txt \
		--output-file $(TRY)/lowest.txt pyproject.toml
	$(TRY)/venv/bin/python -m pip install --quiet --disable-pip-version-check -r $(TRY)/lowest.txt
	$(TRY)/venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps $(TRY)/dist/*.whl
	$(call tests_of_wheel)

define tests_of_wheel
mkdir $(TRY)/run && cp -r tests examples docs benchmarks README.md CHANGELOG.md CONTRIBUTING.md pyproject.toml $(TRY)/run
cd $(TRY)/run && ../venv/bin/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder
endef

$(VENV)/.python:
	@python=$$($(FIND_PYTHON)); \
	if [ -z "$$python" ]; then echo "stablepush needs Python 3.11 or newer" >&2; exit 1; fi; \
	$$python -m venv $(VENV)
	@touch $@

$(VENV)/.installed: $(VENV)/.python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/.installed-test: $(VENV)/.python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test]'
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-docs: $(VENV)/.python pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) $(TRY) stablepush-demo docs/_build docs/gallery docs/sg_execution_times.rst examples/gallery/*.png

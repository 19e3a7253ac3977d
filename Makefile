# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
.PHONY: help demo controller check explore reliability docs package clean
help:
	@echo 'make demo         set up a virtual environment and show a linkage move'
	@echo 'make controller   let a controller keep the speed of a torque-driven linkage, and compare'
	@echo 'make check        set up a virtual environment and run every check, as CI does'
	@echo 'make explore      try the laws of random mechanisms with fresh seeds, for 20 minutes'
	@echo 'make reliability  kill, fill, cut, soak and fuzz: nearly three hours, as root'
	@echo 'make docs         build the documentation site, with the API and movies, in the folder site'
	@echo 'make package      build sdist and wheel into dist, and try them in a fresh environment'
	@echo 'make clean        remove what these made'
	@echo 'PYTHON=$(or $(ANY),/path/to/python) make ...  uses that Python; any from 3.10 to 3.13 will do'

# The first Python of a list that fits; one that can also make virtual environments, if any can.
fits = $(shell for python in $(1); do "$$python" -c 'import sys; \
	[__import__(name) for name in "$(2)".split()]; \
	sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1 \
	&& echo "$$python" && break; done)
first = $(or $(call fits,$(1),venv ensurepip),$(call fits,$(1)))
ANY = $(call first,python3.13 python3.12 python3.11 python3.10 python3 python)
BASE := $(call first,$(or $(PYTHON),python3 python python3.13 python3.12 python3.11 python3.10))
VERSION := $(if $(BASE),$(shell "$(BASE)" -c 'import sys; print("%d.%d" % sys.version_info[:2])'))

# Where ROS 2 Jazzy is sourced, the environment takes that rclpy and must not hide it.
JAZZY := $(and $(BASE),$(filter jazzy,$(ROS_DISTRO)),$(shell "$(BASE)" -c 'import rclpy' \
	2>/dev/null && echo yes))
ifdef JAZZY
VENV := .venv-$(VERSION)-jazzy
EXTRAS := viewer
else
VENV := .venv-$(VERSION)
EXTRAS := ros,viewer
# Another ROS, or one for another Python, would be mixed with the wheels of this one.
ifdef ROS_DISTRO
unexport AMENT_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION
endif
endif
RUN := $(VENV)/bin/python
# Python keeps what it compiles, also for whom it usually does not: the tests start hundreds of
# processes, and compiling takes half the time of each.
unexport PYTHONDONTWRITEBYTECODE
SETUP := setup.py setup.cfg lab/pyproject.toml constraints.txt
LAB := --editable ./lab

# An environment whose Python has gone, say by an upgrade, is made again.
$(if $(BASE),$(shell $(RUN) -c '' 2>/dev/null || rm -f $(VENV)/*-ready))

# The pip of the constraints: those that come with Python 3.10 to 3.12 take twice as long. No build
# isolation: it would fetch whatever setuptools is newest, beside the constraints. No compilation:
# Python compiles what it imports, which is a small part. In a terminal a line tells once a second
# how far pip is.
install = { n=0; while [ -t 2 ] && sleep 1 && kill -0 $$$$ 2>/dev/null; do n=$$((n + 1)); printf \
	'\r%d s, %d packages ' $$n "$$(grep -c ^Collecting $(VENV)/pip.log)" >&2; done & }; told=$$!; \
	$(RUN) -m pip install --disable-pip-version-check --no-build-isolation --no-compile \
	--constraint constraints.txt $(1) >>$(VENV)/pip.log 2>&1; code=$$?; \
	kill $$told 2>/dev/null; wait $$told 2>/dev/null; [ ! -t 2 ] || printf '\r\033[K' >&2; \
	[ $$code -eq 0 ] || { \
	if grep -qiE 'connection|timed out|proxyerror|sslerror|max retries' $(VENV)/pip.log; \
	then echo 'Set-up failed: no package index answers. Check the network, then run make again.'; \
	else grep '^ERROR' $(VENV)/pip.log | tail -n 3; echo 'Set-up failed: see $(VENV)/pip.log'; \
	fi >&2; exit 1; }

# Without a screen, what the window would show is written to a file. Without rclpy, the same states
# are recorded and replayed.
SCREEN := $(DISPLAY)$(WAYLAND_DISPLAY)$(WAYLAND_SOCKET)
SECONDS := 10
SHOWN := $(if $(SCREEN),spawn,demo/quadrilateral.rrd)
demo: $(VENV)/demo-ready
	@mkdir -p demo && rm -f demo/quadrilateral.rrd
	@if $(RUN) -c 'import rclpy' 2>/dev/null; then \
	echo 'linkage_node turns the quadrilateral for $(SECONDS) s, its start included'; \
	timeout --foreground --preserve-status --signal INT $(SECONDS) $(RUN) -m \
		linkage_ros.node.linkage_node --ros-args -p log:=demo/quadrilateral.mcap \
		-p log_overwrite:=true -p viewer:=$(SHOWN); else \
	$(RUN) -m linkage_ros.programs.record quadrilateral demo/quadrilateral.mcap \
		--duration $(SECONDS) --overwrite && $(RUN) -m linkage_ros.programs.replay \
		demo/quadrilateral.mcap --no-ros --viewer $(SHOWN) $(if $(SCREEN),,--rate 1000); fi
	@echo 'look inside:      $(VENV)/bin/linkage_log info demo/quadrilateral.mcap'
	@echo 'replay on topics: $(VENV)/bin/linkage_replay demo/quadrilateral.mcap'
	@$(if $(SCREEN),,echo 'watch it in 2-D:  $(VENV)/bin/rerun demo/quadrilateral.rrd')
	@echo 'draw one turn:    $(VENV)/bin/linkage_chart motion quadrilateral'

controller: $(VENV)/demo-ready
	@$(RUN) benchmarks/controller.py --quick --out controller

reliability: $(VENV)/check-ready
	@$(RUN) benchmarks/reliability/run.py --out reliability

docs: $(VENV)/docs-ready
	@$(RUN) -m sphinx -EWq --keep-going -c docs/site -d $(VENV)/doctrees . site
	@echo site/index.html

package: $(VENV)/package-ready
	@$(RUN) test/check_package.py dist

# Plugins of a sourced ROS break today's pytest, so that only those named here are loaded. Three
# processes share the tests, a file at a time, since the tests of a file share what they compute:
# many tests wait, so that two cores serve three, and mypy beside them.
PROGRAMS := .mypy_cache/page_programs
check: $(VENV)/check-ready
	@$(RUN) -m ruff check --quiet
	@$(RUN) -m ruff format --check --quiet
	@printed=$$($(VENV)/bin/lint-imports --no-cache --no-logo) || { echo "$$printed"; exit 1; }
	@rm -rf $(PROGRAMS) && $(RUN) test/pages.py $(PROGRAMS)
	@MYPYPATH=$(dir $(PROGRAMS)) $(RUN) -m mypy --no-error-summary -p linkage_ros -p linkage_lab \
		-p $(notdir $(PROGRAMS)) & types=$$!; \
	PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 $(RUN) -m pytest -q -p _hypothesis_pytestplugin \
		-p xdist -p no:terminaldistreporter -n 3 --dist loadfile --no-loadscope-reorder; \
	code=$$?; wait $$types && exit $$code

# A failure prints how to repeat it, as a decorator of its test.
MINUTES := 20
explore: $(VENV)/check-ready
	@end=$$(($$(date +%s) + 60 * $(MINUTES))); while [ $$(date +%s) -lt $$end ]; do \
	PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 $(RUN) -m pytest -q -p _hypothesis_pytestplugin -p xdist \
		-p no:terminaldistreporter -n 2 --no-loadscope-reorder -m hypothesis \
		--hypothesis-profile explore || exit; done

$(VENV)/pip-ready: $(SETUP)
	@$(if $(BASE),,$(error $(if $(PYTHON),$(PYTHON) is no,No) Python from 3.10 to 3.13 \
	$(if $(PYTHON),that runs here,was found). Install one, or name it: \
	PYTHON=$(or $(ANY),/path/to/python) make))
	@"$(BASE)" -c 'import venv, ensurepip' 2>/dev/null || { \
	echo 'Python $(VERSION) lacks venv. On Debian or Ubuntu: apt install python$(VERSION)-venv' \
	>&2; exit 1; }
	@echo 'Setting up $(VENV), once, in a minute or two ...'
	@"$(BASE)" -m venv --clear $(if $(JAZZY),--system-site-packages) $(VENV)
	@$(call install,pip setuptools)
	@touch $@

$(VENV)/check-ready: EXTRAS := $(EXTRAS),test
$(VENV)/check-ready: LAB := --editable './lab[sweep]'
$(VENV)/docs-ready: EXTRAS := docs
$(VENV)/package-ready: EXTRAS := $(EXTRAS),test,package
$(VENV)/demo-ready $(VENV)/check-ready $(VENV)/docs-ready $(VENV)/package-ready: $(VENV)/pip-ready
	@$(call install,--editable '.[$(EXTRAS)]' $(LAB))
	@touch $@ $(if $(findstring viewer,$(EXTRAS)),$(VENV)/demo-ready)

clean:
	@rm -rf .venv-* build dist install log demo controller reliability site *.egg-info lab/build \
		lab/*.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache

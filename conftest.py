# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Settings for all tests: floating-point warnings are errors, seeds are fixed, signals work."""

import gc
import os
import signal
import sys
from pathlib import Path

# With several threads, small matrices take many times as long on a busy machine. BLAS reads this
# variable when NumPy is imported.
os.environ['OPENBLAS_NUM_THREADS'] = '1'

import numpy as np
import pytest
from hypothesis import settings
from ros_harness import fresh_domain

import linkage_ros.view  # noqa: F401, sets the log level of Rerun before its first import
from linkage_ros import cli

# A program that runs the checks in the background may ignore these signals; children inherit it.
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGQUIT, signal.SIG_DFL),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, handler)

np.seterr(all='raise')
settings.register_profile(
    'repeatable', deadline=None, derandomize=True, database=None, max_examples=30
)
settings.register_profile(
    'explore', deadline=None, database=None, print_blob=True, max_examples=300
)
settings.load_profile('repeatable')


@pytest.fixture
def called(monkeypatch, capfd):
    """Calls the entry point of a module in this process; returns exit code, stdout and stderr."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(fresh_domain()))
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.getsignal(number) for number in numbers]
    threshold = gc.get_threshold()

    def call(module, *arguments):
        name = module._NAME  # noqa: SLF001
        monkeypatch.setattr(sys, 'argv', [name, *map(str, arguments)])
        capfd.readouterr()
        try:
            code = cli.run(name, module.main)
        except SystemExit as ended:  # argparse
            code = ended.code
        return code, *capfd.readouterr()

    yield call
    # A program collects garbage as suits it; this process goes on.
    gc.set_threshold(*threshold)
    gc.unfreeze()
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.fixture
def undrawn(monkeypatch):
    """Leaves pictures empty, for tests of what a command prints or tabulates; returns figures."""
    figure, figures = pytest.importorskip('matplotlib.figure').Figure, []
    monkeypatch.setattr(
        figure, 'savefig', lambda page, path, **__: figures.append(page) or Path(path).touch()
    )
    return figures


# The longest files run first, so that no process runs one of them alone at the end.
LONGEST = ('test_docs', 'test_browser', 'test_pump_chart', 'test_outcomes', 'test_faults',
           'test_hostile', 'test_methods', 'test_mjcf', 'test_fifty_digits', 'test_replay',
           'test_rerun_connection', 'test_two_hosts', 'test_out_of_package',
           'test_packaging', 'test_sizing', 'test_chart', 'test_node', 'test_launch', 'test_ros',
           'test_torque_driven_motion', 'test_integrators')  # fmt: skip


def pytest_collection_modifyitems(items):
    ranks = {name: rank for rank, name in enumerate(LONGEST)}
    items.sort(key=lambda item: ranks.get(item.path.stem, len(ranks)))

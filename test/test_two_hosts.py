# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Node and controller on two hosts whose link is cut: a short version of the benchmark."""

import json
import sys

import pytest
from pages import ROOT
from ros_harness import finished

SCRIPT = ROOT / 'benchmarks' / 'reliability' / 'hosts.py'


def test_node_and_log_outlast_a_cut_link(tmp_path):
    quick = ('--out', tmp_path, '--short', '3', '--long', '0')
    done = finished([sys.executable, SCRIPT], *quick)
    if done.returncode == 77:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    figures = json.loads((tmp_path / 'hosts.json').read_text())
    (cut,) = figures['cuts']
    # The log contains all states; the subscriber received hardly any of those during the cut.
    assert figures['states_logged'] == figures['states_published'] > figures['heard']
    assert cut['unheard'] > cut['logged'] / 2
    assert cut['time_out_said']
    assert figures['local_is_heard'] is False

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options may have negative values; progress is shown only on a terminal, and erased."""

import io
import math
import sys
import time

import pytest

from linkage_ros.cli import add_options, make_parser, waiting, working
from linkage_ros.quantities import Quantity


class Output(io.StringIO):
    """Captures stderr; `lines` are the lines that a terminal finally shows."""

    def __init__(self, is_terminal):
        super().__init__()
        self.isatty = lambda: is_terminal

    def lines(self):
        shown = []
        for line in self.getvalue().split('\n'):
            row = ''
            for part in line.split('\r'):
                row = part + row[len(part) :]
            shown.append(row.rstrip())
        return shown


@pytest.mark.parametrize(
    ('is_terminal', 'words'), [(True, 'waiting for subscribers'), (False, '')]
)
def test_waiting_line_is_shown_on_a_terminal_and_erased(monkeypatch, is_terminal, words):
    monkeypatch.setattr(sys, 'stderr', output := Output(is_terminal))
    with waiting('waiting for subscribers'):
        assert output.lines() == [words]
        print('no subscribers yet; --delay S', file=sys.stderr)
    assert output.lines() == ['no subscribers yet; --delay S', '']  # on a line of its own


@pytest.mark.parametrize(('is_terminal', 'after', 'is_shown'), [
    (True, 0.0, True), (True, 1e6, False), (False, 0.0, False),
])  # fmt: skip
def test_line_of_slow_work_is_shown_after_a_while_and_erased(
    monkeypatch, is_terminal, after, is_shown
):
    monkeypatch.setattr(sys, 'stderr', output := Output(is_terminal))
    with working('motion', after):
        while is_shown and output.lines() != ['motion']:
            time.sleep(0.001)
    assert output.lines() == ['']
    assert bool(output.getvalue()) == is_shown


@pytest.mark.parametrize(
    ('text', 'value'), [('-135.35deg', math.radians(-135.35)), ('-1e-3', -1e-3), ('-2', -2.0)]
)
def test_value_of_an_option_may_be_negative(text, value):
    angle = Quantity('number', 'an angle', 'rad', -10.0, 10.0)
    parser = make_parser('program', 'Tests.', ())
    add_options(parser, [(('--at',), angle, {}), (('-v',), None, {'action': 'store_true'})])
    options = parser.parse_args(['--at', text, '-v'])
    assert options.at == pytest.approx(value)
    assert options.v

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is waited for is said on a terminal alone, and leaves nothing behind."""

import io
import sys

import pytest

from linkage_ros.progress import waiting


class Output(io.StringIO):
    """What is written to stderr; `lines` are as a terminal shows them in the end."""

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
    assert output.lines() == ['no subscribers yet; --delay S', '']  # it stands alone

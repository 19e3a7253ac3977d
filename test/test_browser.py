# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pages of a replay and of a live run in a real browser, if Chromium is installed."""

import re
import subprocess
from contextlib import contextmanager

import browser
import numpy as np
import pytest
from ros_harness import fresh_domain, running, wait_for
from test_rerun_connection import late_viewer, log, page_of  # noqa: F401, log is a fixture

from linkage_ros.palette import colors_of
from linkage_ros.settings.presets import preset_path
from linkage_ros.units import NS_PER_S


def places(picture, *links):
    """Returns where a part of a picture has the colours of links; empty if one is not shown."""
    masks = [(picture == color).all(axis=-1) for color in colors_of(links).values()]
    return [np.argwhere(mask).tolist() for mask in masks] if all(map(np.any, masks)) else []


@contextmanager
def live_page(_):
    """Runs a node with a fast crank; yields the process and the URL of its page."""
    words = '--ros-args', '--params-file', preset_path('compressor'), '-p', 'viewer:=web'
    with running('node', *words, domain=fresh_domain(), stderr=subprocess.STDOUT) as process:
        lines = iter(process.stdout.readline, '')
        yield (
            process,
            next(filter(None, (re.search(r'browser.* (http://\S+)', x) for x in lines)))[1],
        )


def moves(picture, output, seen):
    """Returns whether the linkage is at another place than in an earlier picture."""
    left, _ = parts(picture)
    if found := places(left, 'crank', 'coupler', output):
        seen.append(found)
    return seen and seen[0] != seen[-1]


def parts(picture):
    """Divides a picture into the linkage and the curves, which have the same colours."""
    return np.split(picture, [picture.shape[1] // 3], axis=1)


@pytest.mark.skipif(not browser.PROGRAM, reason='no browser here: install chromium')
@pytest.mark.parametrize('served', [page_of, live_page])
def test_page_opened_late_and_again_shows_the_linkage_moving(log, tmp_path, served):  # noqa: F811
    """20 s of a replay, or 2 s of a live run, have passed, in the time of the log."""
    late, output = (20, 'rocker') if served is page_of else (2, 'slider')
    with served(log) as (_, page):
        with late_viewer(page, tmp_path / 'saved.rrd') as stamps:
            wait_for(lambda: np.ptp(stamps() or [0]) > late * NS_PER_S)
        for _ in range(2):
            with browser.opened_page(page) as shown:
                seen = []
                # A browser without a graphics card is slow.
                wait_for(lambda: moves(shown.picture(), output, seen))  # noqa: B023
                if served is live_page:  # a replay at 20 times the speed shows few curves
                    wait_for(lambda: places(parts(shown.picture())[1], 'crank'))

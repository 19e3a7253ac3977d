# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a replay in a real browser, if Chromium is installed."""

import browser
import numpy as np
import pytest
from ros_harness import wait_for
from test_rerun_view import late_viewer, log, page_of  # noqa: F401, log is a fixture

from linkage_ros.palette import color_of
from linkage_ros.units import NS_PER_S


def linkage(picture):
    """Returns where a picture shows crank, coupler and rocker; None if one is not shown."""
    left = picture[:, : picture.shape[1] // 3]  # curves have the same colours
    masks = [(left == color_of(link)).all(axis=-1) for link in ('crank', 'coupler', 'rocker')]
    return np.array(masks) if all(mask.any() for mask in masks) else None


@pytest.mark.skipif(not browser.PROGRAM, reason='no browser here: install chromium')
def test_page_opened_after_20_s_shows_the_linkage_moving(log, tmp_path):  # noqa: F811
    with page_of(log) as (_, page):
        with late_viewer(page, tmp_path / 'saved.rrd') as stamps:
            wait_for(lambda: max(stamps(), default=0) > 20 * NS_PER_S)
        with browser.opened_page(page) as shown:
            seen = []

            def moves():
                if (found := linkage(shown.picture())) is not None:
                    seen.append(found)
                return seen and not np.array_equal(seen[0], seen[-1])

            wait_for(moves, 110.0)  # a browser without a graphics card is slow

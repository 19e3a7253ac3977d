# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One palette for Rerun, charts, documents, URDF and RViz."""

from __future__ import annotations

import re

from pages import read

from linkage_ros.palette import BLACK, COLORS, FIRST, GREEN, SECOND, WHITE, fractions, mixed


def test_rviz_has_the_couplers_colour_for_its_point():
    _, point = read('rviz/linkage.rviz').split('Name: Coupler point')
    red, green, blue = COLORS['coupler']
    assert re.search(r'Color: (.*)', point)[1] == f'{red}; {green}; {blue}'


def test_mixtures_lie_between():
    assert mixed(GREEN, WHITE, 0.0) == GREEN
    assert mixed(GREEN, WHITE, 1.0) == WHITE
    assert mixed((0, 100, 200), BLACK, 0.5) == (20, 70, 120)
    assert fractions((0, 51, 255)) == (0.0, 0.2, 1.0)


def test_states_have_colours_that_no_link_has():
    assert FIRST != SECOND
    assert not {FIRST, SECOND} & set(COLORS.values())

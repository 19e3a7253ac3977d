# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Colours of links: all different, and the usual ones for the usual names."""

import itertools

import pytest

from linkage_ros import load, preset_names
from linkage_ros.palette import COLORS, ORANGE, SKY, WHITE, colors_of, fractions

LEG = 'crank', 'j', 'bde', 'k', 'c', 'f', 'gih'


def luminance(color):
    """Returns the relative luminance of a colour (WCAG 2.2)."""
    linear = [
        x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in fractions(color)
    ]
    return sum(w * x for w, x in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize('preset', preset_names())
def test_links_of_presets_keep_their_usual_colors(preset):
    names = load(preset).mechanism.parts()
    dyads = {'first': SKY, 'second': ORANGE, 'slider': ORANGE}
    expected = {x: COLORS.get(x) or dyads[x.rpartition('_')[2]] for x in names}
    assert colors_of(names) == expected


@pytest.mark.parametrize(
    'names', [LEG, 'abcdefgh', ('rocker', 'slider', 'barrel', 'p_first', 'q_first', 'p_rod', 'x')]
)
def test_no_two_of_eight_links_have_one_color(names):
    colors = colors_of(names)
    assert [*colors] == [*names]
    assert len({*colors.values()}) == len(names)


def test_colors_of_links_are_visible_on_white_and_on_black():
    for color in colors_of('abcdefgh').values():
        light = luminance(color)
        assert min((luminance(WHITE) + 0.05) / (light + 0.05), (light + 0.05) / 0.05) > 2.2
    for one, other in itertools.combinations(colors_of('abcdefgh').values(), 2):
        assert max(abs(x - y) for x, y in zip(one, other, strict=True)) > 50

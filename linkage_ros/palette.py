# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Colours for Rerun, charts, documents and URDF.

Apart from greys, brown and cobalt, they are from the colour-blind-safe palette of Okabe and Ito. A
link and its curves have the same colour, which is visible on black and on white; no two of eight
links have the same one. Two colours are also for pairs of other items, such as states, energies or
controllers. In charts without a mechanism, a legend explains the colours.

Public: other packages may import this module.
"""

from collections.abc import Iterable
from typing import TypeAlias

Color: TypeAlias = tuple[int, int, int]

VERMILION: Color = (213, 94, 0)
BLUE: Color = (0, 114, 178)
GREEN: Color = (0, 158, 115)
PURPLE: Color = (204, 121, 167)
ORANGE: Color = (230, 159, 0)
SKY: Color = (86, 180, 233)
# The two colours that are farthest from those above, also as the colour-blind see them.
BROWN: Color = (152, 52, 24)
COBALT: Color = (0, 56, 240)
BLACK: Color = (40, 40, 40)
DARK: Color = (110, 110, 110)
GREY: Color = (150, 150, 150)
WHITE: Color = (255, 255, 255)

COLORS: dict[str, Color] = {
    'crank': VERMILION,
    'coupler': BLUE,
    'rocker': GREEN,
    'rod': PURPLE,
    'barrel': GREEN,
    'slider': GREEN,
}
# Colours of two items that are not links; a third item is grey.
FIRST, SECOND = SKY, ORANGE


# Colours of the links of dyads, whose names begin with that of the dyad.
_DYADS: dict[str, Color] = {
    'first': SKY,
    'barrel': SKY,
    'second': ORANGE,
    'slider': ORANGE,
    'rod': ORANGE,
}
_IN_TURN = VERMILION, BLUE, GREEN, PURPLE, SKY, ORANGE, BROWN, COBALT


def colors_of(links: Iterable[str]) -> dict[str, Color]:
    """Returns the colour of each link of a mechanism.

    The usual names have their own colours; the first eight links have different colours.

    Args:
        links: Names of all moving links.
    """
    names = [*links]
    colors = dict[str, Color]()
    for name in names:
        usual = COLORS.get(name) or _DYADS.get(name.rpartition('_')[2])
        if usual and usual not in colors.values():
            colors[name] = usual
    for name in names:
        if name not in colors:
            used = [*colors.values()]
            colors[name] = min(_IN_TURN, key=used.count)
    return {name: colors[name] for name in names}


def mixed(color: Color, other: Color, share: float) -> Color:
    """Mixes two colours.

    Args:
        color: The colour to change.
        other: The colour to add: WHITE makes the first colour paler, BLACK makes it darker.
        share: Fraction of the added colour, from 0 to 1.

    Returns:
        The mixed colour.
    """
    red, green, blue = (
        round((1 - share) * a + share * b) for a, b in zip(color, other, strict=True)
    )
    return red, green, blue


def fractions(color: Color) -> tuple[float, float, float]:
    """Converts the components of a colour to the range 0 to 1, as in Matplotlib and URDF."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255

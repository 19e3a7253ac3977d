# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The situations in which peers are tested: a four-bar and a sequence of crank angles."""

import math
from dataclasses import dataclass, replace

from linkage_ros import Body, Coupler, FourBar, Frame
from linkage_ros.settings.configuration import load

DEGREE = math.pi / 180


@dataclass(frozen=True)
class Case:
    """A situation for all peers.

    Attributes:
        name: Short name.
        sentence: Description for the page.
        mechanism: The four-bar.
        angles: Crank angles, rad, in the order of the requests; the first is reachable.
        lengths: Exact decimal lengths of crank, coupler, rocker and frame, or None.
    """

    name: str
    sentence: str
    mechanism: FourBar
    angles: tuple
    lengths: tuple | None = None


def four_bar(r, b, c, d):
    """Returns a four-bar of slender links of 0.1 kg."""

    def link(kind, length):
        return kind(length, 0.1, 0.1 * length**2 / 12, (length / 2, 0.0))

    return FourBar(Frame(d), link(Body, r), link(Coupler, b), link(Body, c))


def degrees(start, stop):
    """Returns angles, rad, at intervals of one degree, each correctly rounded."""
    return tuple((start + i) * DEGREE for i in range(round(stop - start) + 1))


def around(place, nearest, beyond):
    """Returns angles that approach a limit; each step divides the distance by about 3."""
    count = round(-2 * math.log10(nearest)) + 1
    offsets = [10 ** (-i / 2) for i in range(count)]
    before = [place - x for x in offsets]
    return tuple(before + [place + x for x in reversed(offsets)] if beyond else before)


def cases():
    """Returns all situations; the lengths of the first three are exact in binary."""
    preset = load('quadrilateral').mechanism
    parallelogram = four_bar(0.125, 0.375, 0.125, 0.375)
    limited = four_bar(0.2, 0.15, 0.17, 0.26)
    # Crank angle at which coupler and rocker are in line.
    r, d, reach = 0.2, 0.26, 0.15 + 0.17
    dead = math.acos((r * r + d * d - reach * reach) / (2 * r * d))
    once = degrees(30.37, 390.37)
    far = 1e6 * 2 * math.pi
    sizes = {
        name: four_bar(size, 3.15 * size, 5 * size, 4.25 * size)
        for name, size in (('tiny', 1e-6), ('huge', 1e6))
    }
    return (
        Case(
            'change point hit', 'A parallelogram turns in steps of 1 deg to a change point, '
            'where all links are in line. Rounding may save a peer from a division by zero.',
            parallelogram, degrees(-60, 0),
        ),
        Case(
            'change point passed', 'The same parallelogram makes a whole turn past both '
            'change points; no state is exactly at a change point.', parallelogram, once,
        ),
        Case(
            'near a change point', 'The links of a crank-rocker miss a change point by '
            '1e-14 m; the crank angles approach it to 1e-8 rad from both sides.',
            four_bar(0.125, 0.375, 0.125 + 1e-14, 0.375),
            around(math.pi, 1e-8, beyond=True),
        ),
        Case(
            'typed in decimals', 'Links of 0.1, 0.2, 0.3 and 0.4 m make a whole turn past '
            'the change point: 0.1 + 0.4 = 0.2 + 0.3 holds in decimals, but not in binary.',
            four_bar(0.1, 0.2, 0.3, 0.4), once,
            ('0.1', '0.2', '0.3', '0.4'),
        ),
        Case(
            'beyond the arc', f'A crank that can reach {dead / DEGREE:.1f} deg is turned '
            'to 150 deg. Where the loop cannot close, every number is wrong.',
            limited, degrees(30, 150),
        ),
        Case(
            'dead centre', 'The same crank approaches the end of its arc to 1e-6 rad.', limited,
            around(dead, 1e-6, beyond=False),
        ),
        Case(
            'crossed assembly', 'The four-bar of Ghalbi 2019 makes a turn in its other assembly.',
            replace(preset, assembly='crossed'), once,
        ),
        Case(
            'tiny links', 'A linkage with a crank of 1e-6 m makes a whole turn.', sizes['tiny'],
            once,
        ),
        Case(
            'huge links', 'A linkage with a crank of 1e6 m makes a whole turn.', sizes['huge'],
            once,
        ),
        Case(
            'equal lengths', 'A rhombus makes a whole turn past both of its change points.',
            four_bar(0.25, 0.25, 0.25, 0.25), once,
        ),
        Case(
            'few steps', 'A double-crank is solved at five angles per turn, for two turns.',
            four_bar(0.55, 0.4, 0.55, 0.12), tuple((0.5 + i) * 72 * DEGREE for i in range(10)),
        ),
        Case(
            'long run', 'The four-bar of Ghalbi 2019 makes a whole turn in steps of 10 deg, '
            'starting at a crank angle of a million turns.', preset,
            tuple(far + 10 * i * DEGREE for i in range(37)),
        ),
    )  # fmt: skip

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces at points, springs, viscous pins, gas and curves over two turns.

The reference solves Newton's and Euler's equations of all bodies in absolute coordinates.
"""

from dataclasses import replace

import pytest
from mechanisms import FULL, PUMPS, TURN, force_errors, four_bar, slider_crank, worst_errors

from linkage_ros import (
    Force,
    Friction,
    Gas,
    LoadCurve,
    Pins,
    Solver,
    Spring,
)

CLOSE = 1e-11
MECHANISMS = {
    'four_bar': four_bar(FULL['crank_rocker'], 1.3),
    'slider_crank': slider_crank(FULL['offset_right'], 5.5, 'crossed'),
    'wind_pump': PUMPS['pump'],
}
LINKS = {
    'four_bar': ('crank', 'coupler', 'rocker'),
    'slider_crank': ('crank', 'coupler', 'slider'),
    'wind_pump': ('crank', 'coupler', 'rod', 'slider'),
}
FRICTION = {'four_bar': Friction(0.1, 0.05), 'slider_crank': Friction(0.1, 0.05, 0.2)}
CASES = [
    *((name, Force(link, (30.0, -50.0), (0.2, -0.3), axes))
      for name, links in LINKS.items() for link in links for axes in ('world', 'link')),
    *((name, Spring(link, (0.2, 0.1), to, (-0.4, 0.9), 80.0, 0.3, 5.0))
      for name, links in LINKS.items()
      for i, link in enumerate(links) for to in (*links[i + 1:], 'frame')),
    ('four_bar', Spring('coupler', (0.2, 0.1), 'frame', (0.4, 0.3), 80.0)),
    *((name, Pins(7.0, pin)) for name, pins in (
        ('four_bar', ('', 'A0', 'A', 'B', 'B0')), ('slider_crank', ('', 'A0', 'A', 'B')),
        ('wind_pump', ('', 'A0', 'A', 'B', 'D'))) for pin in pins),
    *(('slider_crank', Gas('slider', 0.2, 0.1, 1e5, outlet, exponent, 0.9e5, top))
      for outlet in (None, 1.5e5) for exponent in (1.0, 1.3) for top in ('far', 'near')),
    *((name, LoadCurve('crank', at=(-7.0, -5.0, 1.5), value=(2.0, 9.0, -4.0)))
      for name in LINKS),
    ('slider_crank', LoadCurve('slider', at=(0.5, 4.0, 0.5 + 2 * TURN), value=(4.0, -9.0, 4.0))),
    ('slider_crank', LoadCurve('slider', at=(0.5, 4.0, 9.0), pressure=(1e5, 5e5, 9e4), bore=0.1)),
]  # fmt: skip


def error(mechanism, cranks, speed=2.0, acceleration=1.5):
    """Computes the largest error of torque, joint forces, shaking force and moment, and loads."""
    solver = Solver(mechanism)
    states = worst_errors(solver, cranks, speed, acceleration, period=0, floor=1e-2)
    return max(*states, *force_errors(solver, cranks, speed, acceleration))


@pytest.mark.parametrize(('name', 'load'), CASES, ids=lambda x: getattr(x, 'label', x))
def test_each_load_on_each_link_gives_the_forces_of_newton_and_euler(name, load):
    mechanism = replace(MECHANISMS[name], loads=(load,))
    assert error(mechanism, [0.8, -3.0]) < CLOSE


@pytest.mark.parametrize('name', LINKS)
@pytest.mark.parametrize('speed', [2.0, -40.0])
def test_all_loads_with_friction_give_the_forces_of_newton_and_euler(name, speed):
    loads = [load for owner, load in CASES if owner == name]
    friction = [FRICTION[name]] if name in FRICTION else []
    mechanism = replace(MECHANISMS[name], loads=(*loads, *friction))
    assert error(mechanism, [1.3, 9.0], speed) < CLOSE

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Diagrams of a period: curves that are told apart in grey, names that do not overlap, ticks."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from test_sketch import JANSEN

from linkage_lab.charts.curves import Curve, Panel, only_in_table, panels
from linkage_lab.command_line import QUANTITIES
from linkage_lab.output import dash, round_ticks, spread
from linkage_lab.period import period_to_show, speed_driven_period
from linkage_ros import Body, Coupler, Dyad, Force, FourBar, Frame
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.presets import preset_names


def period_of(source):
    given = isinstance(source, str)
    design = (load(source) if given else configure(source)).only
    return period_to_show(source if given else 'drawn', design, None)[0]


def with_eleven_links():
    """A four-bar that carries four dyads, with more links than colours."""
    mechanism = FourBar(
        Frame(length=0.4), Body(length=0.1), Coupler(length=0.35), Body(length=0.3)
    )
    dyads = tuple(
        Dyad(
            name=f'd{i}', from_='rocker', from_at=(0.3, 0.0), to='frame', to_at=(0.8, 0.1 * i),
            first=Body(length=0.5), second=Body(length=0.4),
        )
        for i in range(4)
    )  # fmt: skip
    return replace(mechanism, dyads=dyads)


@pytest.mark.parametrize('source', [*preset_names(), JANSEN])
def test_curves_of_a_diagram_differ_in_name_and_dash(source):
    period = period_of(source)
    for panel in panels(period, QUANTITIES):
        for one, other in itertools.combinations(panel.curves, 2):
            assert one.name != other.name
            assert dash(one.dash) != dash(other.dash)
            assert one.unit == other.unit


def test_more_links_than_colours_differ_in_colour_or_dash():
    period = speed_driven_period(with_eleven_links(), 1.0)
    (directions,) = panels(period, ['position'])
    styles = [(curve.color, dash(curve.dash)) for curve in directions.curves]
    assert len({color for color, _ in styles}) < len(styles) == len({*map(str, styles)})


def test_only_what_changes_is_drawn():
    mechanism = replace(
        load('quadrilateral').mechanism,
        loads=(Force('coupler', force=(0.0, -9.0), name='weight'),),
    )
    found = {x.title: x for x in panels(speed_driven_period(mechanism, 2.0), ['torque', 'load'])}
    assert {title for title, panel in found.items() if panel.is_constant} == {'Force weight'}
    period = period_of('quadrilateral')
    noise = Curve('x', 'm', period, 1.0 + 1e-15 * np.sin(period.crank))
    assert Panel('Point', [noise]).without_noise().is_constant
    assert not Panel('Point', [replace(noise, values=np.sin(period.crank))]).is_constant


@pytest.mark.parametrize(
    'ends', [[0.5], [0.1, 0.9], [0.5, 0.5, 0.5], [0.3, 0.31, 0.29, 0.8], [0.0, 0.0, 1.0, 1.0]]
)
def test_names_at_ends_keep_their_order_and_distance(ends):
    found = spread(ends, 0.1)
    places = sorted(found)
    assert all(np.diff(places) > 0.1 - 1e-12)
    assert np.argsort(found, kind='stable').tolist() == np.argsort(ends, kind='stable').tolist()
    far = [x for x in ends if sum(abs(x - y) < 0.3 for y in ends) == 1]
    assert {*far} <= {*found}  # a name that has room is beside its curve


@pytest.mark.parametrize(
    ('low', 'high', 'unit', 'expected'),
    [
        (0, 720, 'deg', [0, 180, 360, 540, 720]), (0, 360, 'deg', [0, 90, 180, 270, 360]),
        (259.4, 460.6, 'deg', [270, 315, 360, 405, 450]), (0, 9, 's', [0, 2, 4, 6, 8]),
        (-0.05, 0.042, 'm', [-0.04, -0.02, 0, 0.02, 0.04]),
        (78.2, 81.9, 'deg', [79, 80, 81]),
    ],
)  # fmt: skip
def test_ticks_are_round(low, high, unit, expected):
    axes = Figure().add_subplot()
    axes.set_xlim(low, high)
    round_ticks(axes.xaxis, unit, 5)
    ticks = [round(x, 9) for x in axes.get_xticks() if low <= x <= high]
    assert ticks == expected


@pytest.mark.parametrize('mass', [0.0, 1.0])
def test_torque_and_power_are_left_out_if_nothing_needs_them(mass):
    rod = {'drawing.links.c.mass': mass, 'drawing.links.c.center': [-20.0, -40.0]}
    given = {name: value for name, value in JANSEN.items() if not name.startswith('loads')}
    period = period_of(given | (rod if mass else {}))
    shown = {panel.heading.partition(',')[0] for panel in panels(period, QUANTITIES)}
    assert ('Driving torque' in shown) == bool(mass)
    assert [panel.title for panel in only_in_table(period)] == ['Driving power'] * bool(mass)

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms for tests, and comparison of their states with the reference.

Most have masses on all links and no symmetry, so that no term of an equation vanishes.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from mpmath import mp
from oracle import oracle_of, wrap

from linkage_ros import (
    Barrel,
    Body,
    Coupler,
    Dyad,
    DyadSlider,
    FourBar,
    Frame,
    Guide,
    InvertedSliderCrank,
    LinkLoad,
    LoadCurve,
    Piston,
    Rod,
    Slider,
    SliderCrank,
    TracedPoint,
    WindPump,
)
from linkage_ros.formulas import ZERO
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.settings.configuration import read_values

# Parameters of the quadrilateral whose crank is measured; a preset would also set its motion.
FOLLOWED = {
    **{k: v for k, v in read_values('quadrilateral').items() if k not in {'rpm', 'rate_hz'}},
    'drive': 'follow',
}
TURN = 2 * math.pi
ASSEMBLIES = 'open', 'crossed'


def traced(mechanism, unit=1.0):
    """Adds a traced point to each link; `unit` scales lengths."""
    at = 0.4 * unit, 0.7 * unit
    links = mechanism.structure().links
    points = [TracedPoint(f'{link.name}_point', link.name, at) for link in links]
    return replace(mechanism, points=points)


def four_bar(lengths, angle=0.3, assembly='open', unit=1.0, gravity=(1.3, -9.7)):
    """Makes a four-bar from the lengths of its links; `unit` scales lengths and dynamics."""
    r, b, c, d = (float(x) * unit for x in lengths)
    linkage = FourBar(
        Frame(d, angle),
        Body(r, 0.7, 0.02 * unit**2, (0.3 * r, -0.2 * r)),
        Coupler(b, 2.0, 0.5 * unit**2, (0.6 * b, 0.3 * b)),
        Body(c, 3.0, 0.3 * unit**2, (0.4 * c, -0.25 * c)),
        assembly,
        tuple(x * min(unit, 1e4) for x in gravity),
    )
    return traced(linkage, unit)


def slider_crank(lengths, angle=0.3, assembly='open', unit=1.0):
    """Makes a slider-crank from crank, coupler and offset."""
    r, b, e = (float(x) * unit for x in lengths)
    linkage = SliderCrank(
        Body(r, 0.7, 0.02 * unit**2, (0.3 * r, -0.2 * r)),
        Coupler(b, 2.0, 0.5 * unit**2, (0.6 * b, 0.3 * b)),
        Slider(offset=e, mass=1.5),
        Guide(angle),
        assembly,
        tuple(x * min(unit, 1e4) for x in (1.3, -9.7)),
        (LinkLoad('slider', 6.0 * unit, 0.9),),
    )
    return traced(linkage, unit)


def wind_pump(lengths, assembly='crossed', unit=1.0):
    """Makes a wind pump from crank, coupler and rod."""
    r, b, c = (float(x) * unit for x in lengths)
    pump = WindPump(
        Body(r, 0.7, 0.02 * unit**2, (0.3 * r, -0.2 * r)),
        Coupler(b, 2.0, 0.5 * unit**2, (0.6 * b, 0.3 * b)),
        Body(c, 3.0, 0.3 * unit**2, (0.4 * c, -0.25 * c)),
        Piston(position=c, mass=1.5),
        assembly,
        tuple(x * min(unit, 1e4) for x in (1.3, -9.7)),
        (LinkLoad('slider', damping=0.9),),
    )
    return traced(pump, unit)


def cylinder(lengths, angle=0.3, unit=1.0, **more):
    """Makes an inverted slider-crank from crank, frame and offset."""
    r, d, e = (float(x) * unit for x in lengths)
    linkage = InvertedSliderCrank(
        Frame(d, angle),
        Body(r, 0.7, 0.02 * unit**2, (0.3 * r, -0.2 * r)),
        Barrel(2.0, 0.5 * unit**2, (0.3 * d, 0.1 * d)),
        Rod(1.5, 0.3 * unit**2, (-0.4 * r, 0.2 * r)),
        e,
        tuple(x * min(unit, 1e4) for x in (1.3, -9.7)),
        **{'loads': (LinkLoad('rod', 6.0 * unit, 0.9),)} | more,
    )
    return traced(linkage, unit)


# Four-bars: crank, coupler, rocker, frame. The first pass two change points per turn (p0 = 0 and
# q0 = 0), the next pass one at theta = pi (p0 = 0), the last pass one at theta = 0 (q0 = 0).
# Slider-cranks: crank, coupler, offset; one change point per turn on the side opposite to the
# offset, or two without an offset.
CHANGE_POINTS = {
    'parallelogram': (1, 2, 1, 2),
    'kite_r_b': (1, 1, 2, 2),
    'kite_r_b_long_crank': (2, 2, 1, 1),
    'rhombus': (1, 1, 1, 1),
    'p0': (1, 2.5, 1.5, 3),
    'p0_double_crank': (2.5, 2, 1.5, 1),
    'q0_coupler_longest': (1, 3.5, 2.5, 2),
    'q0_rocker_longest': (1, 2.5, 3.5, 2),
    'q0_double_crank': (3, 2.5, 1.5, 1),
    'kite_r_d': (1, 2, 2, 1),
    'lower': (1, 1.5, 0.5),
    'upper': (1, 1.5, -0.5),
    'lower_long_offset': (0.5, 2.5, 2),
    'upper_long_offset': (0.5, 2.5, -2),
    'both': (1, 1, 0),
}
# Cranks that turn fully without a change point.
FULL = {
    'crank_rocker': (1, 3, 2.5, 2.2),
    'double_crank': (3, 2.5, 2.2, 1),
    'centric': (1, 2.5, 0),
    'offset_left': (1, 2.2, 0.7),
    'offset_right': (1, 2.2, -0.7),
    'short_coupler': (1, 1.1, 0),
    'offset_longer_than_crank': (0.5, 3, 1.5),
}
LIMITED = {
    'rocker_crank': (2, 3, 1, 2.5),
    'double_rocker': (2, 1, 2.5, 3),
    'double_rocker_two_arcs': (2, 1, 1.5, 2),
    'triple_rocker_far': (2, 1.5, 1.2, 2.2),
    'triple_rocker_near': (1.5, 1.2, 3, 1.6),
    'p0_and_near_limit': (2, 4, 1, 3),
    'offset_left': (2, 2.5, 1),
    'offset_right': (2, 2.5, -1),
    'long_crank': (3, 2, 1.5),
    'offset_longer_than_coupler': (1, 2, 2.5),
    'offset_longest': (1, 0.5, -1.2),
    'rotating_coupler': (3, 1, 0.5),
    'rotating_coupler_far_offset': (3, 1, -1.5),
    'rotating_coupler_centric': (2, 1, 0),
    'upper_change_point': (3, 2, 1),
    'lower_change_point': (3, 2, -1),
}


def of(lengths, *args, **kwargs):
    """Makes a four-bar from four lengths, or a slider-crank from three."""
    return (four_bar if len(lengths) == 4 else slider_crank)(lengths, *args, **kwargs)


DOCUMENT_1 = FourBar(
    Frame(0.425, 5.497787143782138),
    Body(0.1, inertia=0.0245),
    Coupler(0.315, 2.0, 0.016, (0.1575, 0.0)),
    Body(0.5, 3.5, 0.066, (0.25, 0.0)),
)
PUMPS = {
    'pump': wind_pump((0.5, 1.6, 2.3)),
    'pump_open': wind_pump((0.5, 1.6, 2.3), 'open'),
    'pump_short_rod': wind_pump((0.4, 2.3, 1.6)),
    'document_3': WindPump(
        Body(0.12, 20.0, 20.0, (-0.24, 0.0)),
        Coupler(0.8, 40.0, 1.2, (0.72, 0.0)),
        Body(1.6, 4.0, 0.85, (0.8, 0.0)),
        Piston(1.5, 0.0, 6.0),
        'crossed',
        loads=(LinkLoad('slider', damping=60.0),),
    ),
}
CYLINDERS = {
    'swinging_barrel': cylinder((1, 2.5, 0.7)),
    'turning_barrel': cylinder((2.5, 1, -0.6), -2.0),
    'slotted_lever': cylinder((1, 2.2, 0), 5.5),
    'close_pivots': cylinder((1, 1.0625, 0.03125)),
}
DRIVEN_SLIDERS = {
    f'{name}_slider_driven': replace(slider_crank(lengths, angle, way), input='slider')
    for name, lengths, angle, way in (
        ('centric', FULL['centric'], 0.3, 'open'),
        ('offset_right', FULL['offset_right'], 5.5, 'crossed'),
        ('limited', LIMITED['offset_left'], -2.0, 'open'),
        ('rotating_coupler', LIMITED['rotating_coupler'], 0.3, 'crossed'),
        ('equal_links', CHANGE_POINTS['both'], 0.3, 'open'),
        ('equal_links_offset', (1, 1, 0.4), 0.3, 'crossed'),
        ('upper', CHANGE_POINTS['upper'], 1.2, 'crossed'),
        ('long_crank', LIMITED['lower_change_point'], 0.3, 'open'),
    )
}
# Some terms of the equations are absent.
PENDULUM = replace(four_bar(FULL['crank_rocker'], 1.1), coupler=Coupler(3.0), rocker=Body(2.5))
LIGHT_ROD = replace(
    slider_crank(FULL['offset_right'], 2.4),
    coupler=Coupler(2.2),
    slider=Slider(-0.7),
)
# With springs, damping, forces and load curves.
SPRUNG_ROCKER = replace(
    four_bar(FULL['crank_rocker'], 1.3),
    rocker=Body(2.5, 3.0, 0.3, (1.0, -0.625)),
    loads=(
        LinkLoad('rocker', 3.0, 0.7, 11.0, 3.4, name='a'),
        LoadCurve('rocker', 'position', (2.7, 3.1, 3.3), (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)),
    ),
)
SPRUNG_SLIDER = replace(
    slider_crank(FULL['offset_right'], 5.5, 'crossed'),
    loads=(
        LinkLoad('slider', -4.0, 0.9, 12.0, 1.3, name='a'),
        LoadCurve('slider', at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
    ),
)
SPRUNG_PUMP = replace(
    wind_pump((0.5, 1.6, 2.3)),
    slider=Piston(2.3, 0.0, 1.5),
    loads=(
        LinkLoad('slider', -4.0, 0.9, 12.0, 1.8, name='a'),
        LoadCurve('slider', 'position', (1.7, 2.1, 2.4), (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)),
        LoadCurve('crank', at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
    ),
)


def sliding(base, on, name='shoe', length=6.0, at=(3.2, -1.4), **rest):
    """Adds a link from the frame and a slider on a guide of a link."""
    slider = DyadSlider(1.2, (0.6, 0.3), 0.7, on, 0.3, (0.2, -0.3))
    dyad = Dyad(
        name=name, from_='frame', from_at=at, slider=slider,
        first=Body(length, 0.8, 0.2, (0.4 * length, 0.1)), **rest,
    )  # fmt: skip
    return replace(base, dyads=(*base.dyads, dyad))


def telescopic(base, from_, to, name='ram', at=(2.6, 3.4)):
    """Adds a barrel and a rod between points of two links."""
    dyad = Dyad(
        name=name, from_=from_, from_at=(0.3, 0.2), to=to, to_at=at, offset=0.4,
        barrel=Barrel(0.9, 0.3, (0.5, -0.2)), rod=Rod(0.7, 0.2, (-0.4, 0.3)),
    )  # fmt: skip
    return replace(base, dyads=(*base.dyads, dyad))


TIP = 2.1, 2.7
_CRANK_ROCKER = four_bar(FULL['crank_rocker'])
_CENTRIC = slider_crank(FULL['centric'])
# With dyads whose guides move: on each kind of link, and in barrels between links.
MOVING_GUIDES = {
    'guide_on_crank': sliding(_CRANK_ROCKER, 'crank'),
    'guide_on_coupler': sliding(_CRANK_ROCKER, 'coupler', assembly='crossed'),
    'guide_on_rocker': sliding(_CRANK_ROCKER, 'rocker'),
    'guide_on_slider': sliding(_CENTRIC, 'slider', at=(3.2, 2.4)),
    'guide_on_driven_slider': sliding(
        DRIVEN_SLIDERS['offset_right_slider_driven'], 'slider', length=9.0
    ),
    'guide_on_barrel': sliding(CYLINDERS['swinging_barrel'], 'barrel'),
    'guide_on_rod_of_driven_cylinder': sliding(
        replace(CYLINDERS['swinging_barrel'], input='cylinder'), 'rod'
    ),
    'guide_on_rod_of_pump': sliding(PUMPS['pump'], 'rod'),
    'guide_on_link_of_dyad': sliding(sliding(_CENTRIC, 'coupler'), 'shoe_first', 'tip', 9.0, TIP),
    'guide_on_moving_slider': sliding(
        sliding(_CENTRIC, 'coupler'), 'shoe_slider', 'tip', 9.0, TIP
    ),
    'guide_on_slider_on_slider': sliding(
        sliding(_CENTRIC, 'slider', at=(3.2, 2.4)), 'shoe_slider', 'tip', 9.0, TIP
    ),
    'barrel_on_frame': telescopic(_CRANK_ROCKER, 'coupler', 'frame'),
    'barrel_on_coupler': telescopic(_CRANK_ROCKER, 'crank', 'coupler'),
    'barrel_between_slider_and_coupler': telescopic(_CENTRIC, 'slider', 'coupler'),
    'guide_on_barrel_of_dyad': sliding(
        telescopic(_CRANK_ROCKER, 'coupler', 'frame'), 'ram_barrel', 'tip', 9.0, TIP
    ),
    'guide_on_rod_of_dyad': sliding(
        telescopic(_CRANK_ROCKER, 'frame', 'rocker'), 'ram_rod', 'tip', 9.0, TIP
    ),
    'barrel_on_moving_slider': telescopic(sliding(_CENTRIC, 'crank'), 'shoe_slider', 'frame'),
}
# One mechanism of each kind.
ALL = {
    'document_1': DOCUMENT_1,
    'crank_rocker': four_bar(FULL['crank_rocker']),
    'double_crank': four_bar(FULL['double_crank'], -2.0, 'crossed'),
    'parallelogram': four_bar(CHANGE_POINTS['parallelogram']),
    'antiparallelogram': four_bar(CHANGE_POINTS['parallelogram'], 0.3, 'crossed'),
    'kite': four_bar(CHANGE_POINTS['kite_r_d'], 1.2),
    'p0': four_bar(CHANGE_POINTS['p0']),
    'q0': four_bar(CHANGE_POINTS['q0_rocker_longest'], 0.3, 'crossed'),
    'centric': slider_crank(FULL['centric']),
    'offset_right': slider_crank(FULL['offset_right'], 5.5, 'crossed'),
    'upper': slider_crank(CHANGE_POINTS['upper']),
    'lower': slider_crank(CHANGE_POINTS['lower'], 0.3, 'crossed'),
    'equal_links': slider_crank(CHANGE_POINTS['both']),
    'folded': slider_crank(CHANGE_POINTS['both'], 0.3, 'crossed'),
    'inclined_by_turns': slider_crank((0.5, 3, 1.5), 0.3 + 40 * TURN),
    'document_4': SliderCrank(
        Body(1.0, 1.2, 0.1, (0.5, 0.0)),
        Coupler(math.sqrt(2), 0.8, 0.15, (0.7, 0.0)),
        Slider(mass=2.0),
        Guide(),
        loads=(LinkLoad('slider', -3.0, 0.4),),
    ),
    'pendulum': PENDULUM,
    'light_rod': LIGHT_ROD,
    **PUMPS,
    'light_coupler': replace(PUMPS['pump'], coupler=Coupler(1.6)),
    'sprung_rocker': SPRUNG_ROCKER,
    'sprung_slider': SPRUNG_SLIDER,
    'sprung_pump': SPRUNG_PUMP,
    **CYLINDERS,
    'sprung_cylinder': replace(
        CYLINDERS['swinging_barrel'],
        rod=Rod(1.5, 0.3, (-0.4, 0.2)),
        loads=(
            LinkLoad('rod', -4.0, 0.9, 12.0, 1.3, name='a'),
            LoadCurve('rod', at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
        ),
    ),
    **{
        f'{name}_driven': replace(x, input='cylinder', assembly=way)
        for (name, x), way in zip(CYLINDERS.items(), 2 * ASSEMBLIES, strict=True)
    },
    **DRIVEN_SLIDERS,
    **{name: traced(x) for name, x in MOVING_GUIDES.items()},
}


def examples(count):
    """Limits the random examples of a test to `count`; `make explore` tries ten times as many."""
    return settings(max_examples=count * settings().max_examples // 30)


def with_loads(mechanism, *loads):
    """Replaces the loads of a mechanism."""
    return replace(mechanism, loads=loads)


def load_values(kind, name='a', **values):
    """Returns the parameters of a load by dotted name."""
    return {f'loads.{name}.{key}': value for key, value in {'kind': kind, **values}.items()}


class Pushes(NamedTuple):
    """Forces at points of links, each with a couple: (index of the link, point, force)."""

    given: tuple

    def wrenches(self, _links, _rates):
        return [
            Wrench(link, force=force, point=point, couple=2.0) for link, point, force in self.given
        ]

    def potential(self, _links):
        return ZERO


@dataclass(frozen=True)
class SeveralForces(AppliedLoad):
    """A load with several forces on one link: (index of the link, at, force)."""

    given: tuple = ()

    def on(self, mechanism):
        point_of = mechanism.structure().point_of
        return Pushes(tuple((j, point_of(j, at), complex(*x)) for j, at, x in self.given))


# Two forces at one point of the coupler, one at another, and one on the rocker, opposite to it.
SEVERAL_FORCES = SeveralForces(
    (
        (1, (0.1, 0.2), (5.0, 1.0)),
        (1, (0.1, 0.2), (10.0, 2.0)),
        (1, (0.3, 0.0), (0.0, 7.0)),
        (2, (0.1, 0.0), (0.0, -7.0)),
    ),
    name='tool',
)


def turning_parts(mechanism):
    """Returns the names of the parts that turn, in the order of the links."""
    names = 'crank', 'coupler', 'rod', 'rocker'
    return [name for name in names if hasattr(getattr(mechanism, name, None), 'length')]


def longest(mechanism):
    lengths = [getattr(mechanism, name).length for name in turning_parts(mechanism)]
    if isinstance(mechanism, SliderCrank):
        lengths.append(abs(mechanism.slider.offset))
    if isinstance(mechanism, InvertedSliderCrank):
        lengths.append(abs(mechanism.offset))
    return max([*lengths, getattr(mechanism.frame, 'length', 0.0)] if hasattr(mechanism, 'frame')
               else lengths)  # fmt: skip


def coordinates(mechanism, cranks):
    """Returns all coordinates; a wind pump's dyad is open by 0.4 to pi - 0.4 rad.

    A driven slide swings within its stroke; a crossed one, if it has two, at negative positions.
    """
    if mechanism.structure().driven_link.slides:
        low, high = mechanism.reach().arcs[-1 if mechanism.assembly == 'crossed' else 0]
        found = 0.5 * (low + high) + 0.48 * (high - low) * np.sin(1.7 * np.asarray(cranks))
        return (found if np.ndim(cranks) else float(found),)
    if not isinstance(mechanism, WindPump):
        return (cranks,)
    r, b, c = (getattr(mechanism, name).length for name in ('crank', 'coupler', 'rod'))
    with np.errstate(under='ignore'):
        opened = math.pi / 2 + (math.pi / 2 - 0.4) * np.sin(1.7 * np.asarray(cranks))
        square = b * b + c * c - 2 * b * c * np.cos(opened) - (r * np.sin(cranks)) ** 2
        slides = r * np.cos(cranks) + np.sqrt(square)
    return cranks, slides if np.ndim(cranks) else float(slides)


def motion(mechanism, cranks, speed=2.0, acceleration=1.5):
    """Returns coordinates, rates and accelerations, as tuples, with those of a pump's slider."""
    count = len(mechanism.coordinates)
    size = longest(mechanism)
    rates = speed, -0.35 * size * speed
    return coordinates(mechanism, cranks), rates[:count], (acceleration, 0.4 * size)[:count]


def is_free(mechanism):
    """Returns whether the accelerations follow from a torque, as for a wind pump."""
    return isinstance(mechanism, WindPump)


def moving(solver, cranks, speed=2.0, acceleration=1.5, q=None, u=None):
    """Computes the state at crank angles; for a wind pump, `acceleration` is the torque, N m."""
    if not is_free(solver.mechanism):
        return solver.state(*coordinates(solver.mechanism, cranks), speed, acceleration)
    place, rates, _ = motion(solver.mechanism, cranks, speed)
    q, u = q or place, u or rates
    return solver.state(q, u, solver.accelerations(q, u, acceleration))


def asked_of_oracle(mechanism, crank, speed=2.0, acceleration=1.5):
    """Computes the same state with the reference."""
    if not is_free(mechanism):
        return *coordinates(mechanism, crank), speed, acceleration
    q, u, _ = motion(mechanism, crank, speed)
    return q, u, acceleration


def vector(pair):
    """Converts x and y, floats or arrays, to complex numbers."""
    return np.asarray(pair[0]) + 1j * np.asarray(pair[1])


def rows(state):
    """Returns all quantities: positions, velocities, accelerations, torque."""
    return np.array([*state.position, *state.velocity, *state.acceleration, state.torque])


def kinds(mechanism):
    """Returns the order of each quantity (0 to 2, torque 3), and whether its link slides."""
    slides = [link.slides for link in mechanism.structure().links]
    return [(order, slide) for order in range(3) for slide in slides] + [(3, False)]


def worst_errors(solver, angles, speed=2.0, acceleration=1.5, lengths=None, period=8, floor=1e-20):
    """Computes the largest errors of position, velocity, acceleration, torque and points.

    Errors of angles are in rad, other errors relative to the largest value over these angles and
    over `period` more angles, spread over two turns. If this value is below `floor` times the
    natural size of the quantity, as for the rate of a parallelogram's coupler, the natural size
    replaces it.

    Args:
        solver: The solver under test.
        angles: Crank angles, rad; solved one by one and as an array.
        speed: Crank speed, rad/s.
        acceleration: Crank acceleration, rad/s^2; for a wind pump the torque, N m.
        lengths: See Oracle.
        period: Number of angles added for the largest values only; 0 for a limited crank.
        floor: See above.

    Returns:
        The five largest errors over all links, points and both ways of solving.
    """
    oracle = oracle_of(solver.mechanism, lengths and tuple(lengths))
    start = 0.1 if oracle.is_free else float(mp.mpf(angles[0]) - oracle.angle(angles[0])) + 0.1
    spread = [start + 4 * math.pi * i / period for i in range(period)]
    asked = [asked_of_oracle(solver.mechanism, x, speed, acceleration) for x in angles]
    states = [oracle.state(*x) for x in asked]
    rows = [_row(state) for state in states]
    natural = oracle.natural(speed, acceleration)
    usual = moving(solver, np.array(spread), speed, acceleration)
    columns = zip(
        zip(*rows, strict=True), map(_beyond_rounding, _row(usual), natural), strict=True
    )
    largest = [max(map(abs, (*own, *others))) for own, others in columns]
    count = len(oracle.turning)
    for i, turns in enumerate(oracle.turning):
        largest[i] = mp.mpf(1) if turns else largest[i]
    scales = [x if x > floor * n else mp.mpf(n) for x, n in zip(largest, natural, strict=True)]
    if oracle.is_free:  # there the torque is given, and goes through the accelerations
        fastest = [float(max(largest[i * count : (i + 1) * count])) for i in (1, 2)]
        scales[-1] = mp.mpf(oracle.natural(*fastest)[-1])
    alone = [moving(solver, x, speed, acceleration) for x in angles]
    together = moving(solver, np.array(angles), speed, acceleration)
    worst = [0.0] * len(rows[0])
    for got in (map(_row, alone), np.array(_row(together)).T.tolist()):
        for row, right in zip(got, rows, strict=False):
            for i, (x, y) in enumerate(zip(row, right, strict=True)):
                error = mp.mpf(x) - y
                if i < count and oracle.turning[i]:
                    error = wrap(error)
                worst[i] = max(worst[i], float(abs(error) / scales[i]) if scales[i] else 0.0)
    square = speed**2 + abs(acceleration)
    units = [solver.mechanism.crank.length * x for x in (1, abs(speed) or 1, square)]
    traced = [oracle.trace(state) for state in states]
    of_points = _point_errors(solver, traced, usual, (alone, together), units)
    return *(max(worst[i * count : (i + 1) * count]) for i in range(3)), worst[-1], of_points


def _row(state):
    return *state.position, *state.velocity, *state.acceleration, state.torque


def _beyond_rounding(values, size):
    """Keeps only values above the rounding error of a quantity of this size."""
    return [x for x in np.atleast_1d(values).tolist() if abs(x) > 1e-12 * size]


def _point_errors(solver, traced, usual, asked, units):
    """Computes the largest error of any point, relative to the largest length of its vector."""
    (alone, together), worst = asked, 0.0
    for name in traced[0]:
        found, often = (map(vector, solver.point(state, name)) for state in (together, usual))
        one_by_one = zip(*(map(vector, solver.point(state, name)) for state in alone), strict=True)
        for order, each in enumerate(zip(found, one_by_one, often, strict=True)):
            *answers, others = map(np.atleast_1d, each)
            right = [state[name][order] for state in traced]
            size = max(map(abs, (*right, *_beyond_rounding(others, units[order]))))
            if solver.structure.driven_link.is_guided:
                # B moves as given, and the links that lead to it may move much faster.
                size = max(abs(state[each][order]) for state in traced for each in state)
            # B of a folded slider-crank rests at A0.
            size = size if size > 1e-20 * units[order] else units[order]
            for got in answers:
                errors = [abs(mp.mpc(x) - y) for x, y in zip(got.tolist(), right, strict=False)]
                worst = max(worst, float(max(errors) / size))
    return worst


def force_errors(solver, angles, speed=2.0, acceleration=1.5):
    """Computes errors of pin forces, guide force, shaking force and moment, torque and loads.

    Errors of forces are relative to the largest joint force at the same crank angle, errors of
    moments to this force times the largest length. Errors of loads are relative to the largest
    load at any angle. The angles are solved one by one and as an array.
    """
    mechanism = solver.mechanism
    oracle, worst = oracle_of(mechanism), [0.0] * 6
    together = moving(solver, np.array(angles), speed, acceleration)
    forces, loads = solver.reactions(together), solver.load_forces(together)
    asked = (asked_of_oracle(mechanism, crank, speed, acceleration) for crank in angles)
    expected = [oracle.state(*motion) for motion in asked]
    most = max(abs(x) for right in expected for x in right.exerted) or 1
    for i, (crank, right) in enumerate(zip(angles, expected, strict=True)):
        alone = moving(solver, crank, speed, acceleration)
        row = {link: float(np.broadcast_to(x, len(angles))[i]) for link, x in loads.items()}
        pressing = {name: force for name, (force, _) in right.guides.items()}
        force = max(map(abs, (*right.pins.values(), *pressing.values())))
        moment = force * longest(mechanism)
        effort = force if mechanism.structure().driven_link.slides else moment
        for got, exerted in (
            (solver.reactions(alone), solver.load_forces(alone)), (at(forces, i), row),
        ):  # fmt: skip
            pins = [abs(mp.mpc(*got.pins[name]) - right.pins[name]) for name in right.pins]
            guides = []
            for name, (across, turning) in right.guides.items():
                push, couple = got.guides[name]
                guides.append(max(abs(push - across), abs(couple - turning) / longest(mechanism)))
            pushes = zip(solver.links, right.exerted, strict=True)
            pushed = max(abs(exerted.get(link, 0.0) - x) for link, x in pushes)
            errors = (
                max(pins) / force, max(guides, default=0) / force,
                abs(mp.mpc(*got.shaking_force) - right.shaking[0]) / force,
                abs(mp.mpf(got.shaking_moment) - right.shaking[1]) / moment,
                abs(mp.mpf(got.torque) - right.torque) / effort,
                pushed / most,
            )  # fmt: skip
            worst = [max(x, float(y)) for x, y in zip(worst, errors, strict=True)]
    return worst


def at(forces, i):
    """Returns the forces at one of many crank angles."""
    pins = {pin: (float(x[i]), float(y[i])) for pin, (x, y) in forces.pins.items()}
    guides = {name: (float(f[i]), float(m[i])) for name, (f, m) in forces.guides.items()}
    x, y = forces.shaking_force
    return type(forces)(
        pins, guides, (float(x[i]), float(y[i])), float(forces.shaking_moment[i]),
        float(forces.torque[i]),
    )  # fmt: skip


# Mechanisms whose lengths are multiples of a power of two: their sums are exact, so that random
# change points are exact.


@st.composite
def full_four_bars(draw, scales=20):
    shortest = draw(st.integers(4, 256))
    middle = draw(st.integers(shortest, 512))
    long = draw(st.integers(middle, 512))
    far = draw(st.integers(long, long + middle - shortest))
    others = draw(st.permutations((middle, long, far)))
    lengths = draw(st.sampled_from([(shortest, *others), (*others, shortest)]))
    angle = draw(st.integers(-3 * 1024, 3 * 1024)) / 1024
    unit = 2.0 ** (draw(st.integers(-scales, scales)) - 8)
    return four_bar(lengths, angle, draw(st.sampled_from(ASSEMBLIES)), unit)


@st.composite
def full_slider_cranks(draw, scales=20):
    r = draw(st.integers(4, 256))
    offset = draw(st.one_of(st.just(0), st.integers(-256, 256)))
    slack = draw(st.one_of(st.just(0), st.integers(0, 512)))
    angle = draw(st.integers(-3 * 1024, 3 * 1024)) / 1024
    angle += TURN * draw(st.sampled_from([0, 0, -1, 40, -150]))
    unit = 2.0 ** (draw(st.integers(-scales, scales)) - 8)
    lengths = r, r + abs(offset) + slack, offset
    return slider_crank(lengths, angle, draw(st.sampled_from(ASSEMBLIES)), unit)


@st.composite
def wind_pumps(draw, scales=20):
    b, c = draw(st.integers(64, 512)), draw(st.integers(64, 512))
    r = draw(st.integers(4, int(0.35 * min(b, c))))
    unit = 2.0 ** (draw(st.integers(-scales, scales)) - 8)
    return wind_pump((r, b, c), draw(st.sampled_from(ASSEMBLIES)), unit)


@st.composite
def full_cylinders(draw, scales=20):
    r, d = draw(st.tuples(st.integers(4, 512), st.integers(4, 512)).filter(lambda x: x[0] != x[1]))
    offset = draw(st.integers(1 - abs(d - r), abs(d - r) - 1))
    angle = draw(st.integers(-3 * 1024, 3 * 1024)) / 1024
    return cylinder((r, d, offset), angle, 2.0 ** (draw(st.integers(-scales, scales)) - 8))


ANY = {
    'four_bar': full_four_bars,
    'slider_crank': full_slider_cranks,
    'wind_pump': wind_pumps,
    'inverted_slider_crank': full_cylinders,
}

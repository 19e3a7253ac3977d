# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables of charts: refined extremes, the same for a turned and for a mirrored machine."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import ALL, TURN, examples
from transforms import mirrored, turned

from linkage_lab.charts.economy import Economy
from linkage_lab.charts.motion import _measures
from linkage_lab.charts.movie import _frames
from linkage_lab.flywheel import Crank
from linkage_lab.period import extent, law_period, speed_driven_period, stepped
from linkage_lab.sampling import peaks
from linkage_ros import Friction, Gas, Solver, WindPump, load, preset_names, travel
from linkage_ros.motion.drives.law import LawDrive, Prescribed

SPEED = 3.0


def _turns(mechanism):
    reach = None if isinstance(mechanism, WindPump) else Solver(mechanism).reach
    return reach is not None and reach.turns_fully and not reach.slides


MACHINES = {
    name: mechanism for name, mechanism in
    [*ALL.items(), *((name, load(name).mechanism) for name in preset_names())]
    if _turns(mechanism)
}  # fmt: skip
VALVES = (Gas('slider', 0.06, 0.004, 1e5, outlet=5e5, exponent=1.3),)
MACHINES['valves'] = replace(MACHINES['compressor'], loads=VALVES)


def has_finite_forces(mechanism):
    solver = Solver(mechanism)
    return not solver.reach.has_change_point and bool(solver.structure.pins)


def measures(mechanism, speed=SPEED):
    reactions = has_finite_forces(mechanism)
    return _measures(speed_driven_period(mechanism, speed, reactions=reactions))


@cache
def right_measures(name):
    return measures(MACHINES[name])


def assert_same(found, right):
    assert found.keys() == right.keys()
    # The mean power of a machine without losses is a rounding error.
    power = SPEED * right['rms torque [N m]']
    for name, value in right.items():
        if value is None:
            assert found[name] is None
        else:
            size = power if name == 'mean power [W]' else abs(value)
            assert found[name] == pytest.approx(value, rel=0, abs=1e-9 * size), name


@pytest.mark.parametrize('name', MACHINES)
def test_a_machine_turned_as_a_whole_has_the_same_table(name):
    assert_same(measures(turned(MACHINES[name], -2.2)), right_measures(name))


@pytest.mark.parametrize('name', [x for x in MACHINES if has_finite_forces(MACHINES[x])])
def test_a_machine_with_friction_turned_as_a_whole_has_the_same_table(name):
    """Friction bends within an angle as small as the least force in a joint."""
    machine = MACHINES[name]
    guide = 0.1 if any(link.slides for link in machine.structure().links) else 0.0
    rubbing = replace(machine, loads=(
        *(x for x in machine.loads if not isinstance(x, Friction)),
        Friction(pin=0.1, pin_radius=0.002, guide=guide),
    ))  # fmt: skip
    assert_same(measures(turned(rubbing, 0.1234)), measures(rubbing))


@pytest.mark.parametrize('name', MACHINES)
def test_the_mirror_image_at_the_opposite_speed_has_the_same_table(name):
    assert_same(measures(mirrored(MACHINES[name]), -SPEED), right_measures(name))


def test_tables_and_frames_of_the_mirror_image_are_mirrored():
    machine = MACHINES['valves']
    image = mirrored(machine)
    own, other = (speed_driven_period(x, w) for x, w in ((machine, -SPEED), (image, SPEED)))
    tables = [
        {name: column.values for name, column in stepped(period, 7.5).items()}
        for period in (own, other)
    ]
    for name, sign in (('driving_torque', -1), ('driving_power', 1), ('slider.load', 1)):
        size = np.abs(tables[0][name]).max()
        assert tables[1][name][::-1] * sign == pytest.approx(tables[0][name], abs=1e-9 * size)
    track, image_track = (
        period.drawing.place(period.rows('position'))[_frames(period)] for period in (own, other)
    )
    assert np.abs(track - image_track * (1, -1)).max() < 1e-9


def test_a_mirrored_law_has_the_mirrored_torque():
    machine, times, angles = MACHINES['valves'], (0.0, 0.4, 1.0), (0.1, -2.5, 0.1 - TURN)
    found = []
    for one, sign in ((machine, 1), (mirrored(machine), -1)):
        law = Prescribed(times=times, angles=tuple(sign * x for x in angles), repeat=True)
        period = law_period(Solver(one), LawDrive(law))
        torque = extent(period.x, period.columns['driving_torque'].values * sign)
        found.append([torque.low, torque.high, torque.rms, period.mean_power, period.speed])
    assert found[1] == pytest.approx(found[0], rel=1e-9)


@examples(50)
@given(st.floats(0.0, TURN), st.floats(0.2, 3.0), st.booleans())
def test_peaks_of_known_functions_are_exact(at, width, is_sampled):
    """A smooth peak anywhere, also on the seam at 0, with and without the function itself."""
    x = np.linspace(0, TURN, 721)

    def curves(places):
        wave = np.exp((np.cos(places - at) - 1) / width**2)
        return np.stack([wave, 5.0 - wave, 0 * wave + 2.0])

    found, places = peaks(x, curves(x), curves)
    assert found == pytest.approx([1.0, 5.0 - math.exp(-2 / width**2), 2.0], abs=1e-14)
    assert abs(math.remainder(places[0] - at, TURN)) < 1e-6 * width
    if is_sampled:
        assert extent(x, curves(x)[0]).high == pytest.approx(1.0, abs=1e-9)


def test_corners_and_jumps_are_neither_smoothed_nor_crossed():
    jump = math.nextafter(2.0, 3.0)
    x = np.array([*np.linspace(0, 2, 200), jump, *np.linspace(2.01, 4, 200)])

    def curves(places):
        return np.where(places < jump, places, 5 - abs(places - 3.0014))[None]

    found, at = peaks(x, curves(x), curves)
    assert (found[0], at[0]) == pytest.approx((5.0, 3.0014), abs=1e-9)
    found, at = peaks(x, -curves(x), lambda places: -curves(places))
    assert (found[0], at[0]) == (0.0, 0.0)


def test_strokes_and_swings_are_those_of_travel():
    for name in ('slider_crank', 'quadrilateral', 'shaper'):
        solver = Solver(MACHINES[name])
        low, high = travel(solver).extremes
        found = measures(MACHINES[name])
        span = found['stroke [m]'] or math.radians(found['swing [deg]'])
        assert span == pytest.approx(high - low, rel=1e-15)


def test_peak_shaking_force_is_that_of_many_samples():
    mechanism = MACHINES['crank_rocker']
    solver = Solver(mechanism)
    state = solver.state(np.linspace(0, TURN, 200_001), SPEED)
    force = np.hypot(*solver.reactions(state).shaking_force).max()
    assert measures(mechanism)['peak shaking force [N]'] == pytest.approx(force, rel=1e-8)


@pytest.mark.parametrize('name', ['shaper', 'valves'])
def test_flywheel_and_economy_of_the_mirror_image_are_the_same(name):
    """Valves, curves over position and friction have other corners at a negative speed."""
    machine, rpm = MACHINES[name], 200.0
    image, speed = mirrored(machine), rpm * math.pi / 30
    found = [
        (crank.energy(way * speed), crank.inertia_for(0.3, way * speed), cycle.torque[0] * way)
        for one, way in ((machine, 1), (image, -1))
        for crank in [Crank(one)] for cycle in [crank.cycle(way * speed, 50.0)]
    ]  # fmt: skip
    assert found[1] == pytest.approx(found[0], rel=1e-9, abs=1e-9 * abs(found[0][0]))
    errors = [
        [economy._error(economy._without(term), way * rpm) for term in [*economy.terms][:4]]
        for economy, way in ((Economy(machine, ''), 1), (Economy(image, ''), -1))
    ]  # fmt: skip
    assert errors[1] == pytest.approx(errors[0], rel=1e-9, abs=1e-12)


def test_a_smallest_value_of_zero_has_no_minus_sign():
    x = np.linspace(0.0, 1.0, 20)
    assert math.copysign(1.0, extent(x, x).low) == 1.0

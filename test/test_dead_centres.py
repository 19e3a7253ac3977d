# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions past singularities of their own coordinates: dead centres and stretched dyads."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import DRIVEN_SLIDERS, LIMITED, cylinder, of, wind_pump, with_loads
from one_linkage import with_linkage
from ros_harness import logged, report_of, verified

from linkage_ros import Solver
from linkage_ros.errors import LinkageError, MotionError
from linkage_ros.log.writer import LogWriter
from linkage_ros.mechanism import program
from linkage_ros.mechanism.base import Description
from linkage_ros.mechanism.registry import MECHANISMS as MECHANISM_KINDS
from linkage_ros.mechanism.tracer import Tape
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives.torque import TorqueDrive
from linkage_ros.motion.steps import live_steps, record_steps
from linkage_ros.motion.under_torque import Motor, legible
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.units import NS_PER_MS

STRETCHED = wind_pump((0.5, 0.6, 0.7), 'open')
MECHANISMS = {
    **{name: of(lengths) for name, lengths in LIMITED.items()},
    'cylinder': cylinder((1, 2.2, 2.1)),
    'cylinder_long_crank': cylinder((2.2, 1, -1.9), -2.0),
    'driven_cylinder': cylinder((1, 2.2, 0.3), input='cylinder'),
    'driven_short_cylinder': cylinder((1, 2.2, 1.7), 2.0, input='cylinder', assembly='crossed'),
    **DRIVEN_SLIDERS,
    'pump': STRETCHED,
}
# Their arcs contain a change point, where all links are in line and all coordinates are singular.
WITH_CHANGE_POINT = {
    'p0_and_near_limit', 'upper_change_point', 'lower_change_point',
    *(f'{name}_slider_driven' for name in ('equal_links', 'upper', 'long_crank')),
}  # fmt: skip
every = pytest.mark.parametrize('name', [x for x in MECHANISMS if x not in WITH_CHANGE_POINT])


def free(mechanism):
    """Returns the mechanism without damping and friction."""
    return with_loads(mechanism)


def start(mechanism):
    """Returns coordinates and rates, away from every limit."""
    reach = mechanism.reach()
    if reach is None:
        return 0.7, 1.0, 3.0, 0.4
    low, high = reach.arcs[0]
    return low + 0.4 * (high - low), 4.0


def begun(integrate, mechanism):
    return integrate(
        DrivenMechanism(Solver(mechanism), lambda speed: 0.0 * speed), start(mechanism)
    )


def total(steps):
    half, solver = len(steps.phase) // 2, steps.driven.solver
    return solver.energy(solver.state(steps.phase[:half], steps.phase[half:]))


@pytest.mark.parametrize('name', MECHANISMS)
def test_state_is_equal_in_all_coordinates(name):
    """In the other coordinates, one of the two assemblies has the position of the links."""
    mechanism = MECHANISMS[name]
    own, y = Solver(mechanism), start(mechanism)
    half = len(y) // 2
    q, u, torque = y[:half], y[half:], 0.7
    due = own.driven_state(q, u, torque)
    assert own.state(q, u, own.accelerations(q, u, torque)).torque == pytest.approx(torque)
    found, apart = [], []
    for assembly in ('open', 'crossed'):
        other = Solver(mechanism, description=Description(mechanism.other_coordinates, assembly))
        moving = [other.links.index(name) for name in other.coordinates]
        found.append(
            other.driven_state(
                tuple(due.position[i] for i in moving), tuple(due.velocity[i] for i in moving),
                torque,
            )
        )  # fmt: skip
        turned = np.subtract(found[-1].position, due.position)
        turned[: len(turned) - own.structure.links[-1].slides] %= 2 * math.pi
        apart.append(np.abs(np.sin(0.5 * turned)).max())
    assert min(apart) < 1e-13 < 1e-3 < max(apart)
    state = found[int(np.argmin(apart))]
    for row, other_row in zip(state[1:3], due[1:3], strict=True):
        np.testing.assert_allclose(row, other_row, rtol=1e-10, atol=1e-10)


@every
@pytest.mark.parametrize('integrate', [live_steps, record_steps])
def test_energy_is_conserved_past_dead_centres(name, integrate):
    steps = begun(integrate, free(MECHANISMS[name]))
    before, largest, described = sum(total(steps)), 0.0, set()
    for tick in range(1, 301):
        steps.advance(tick * 1e-2)
        kinetic, potential = total(steps)
        largest = max(largest, kinetic)
        described.add(steps.driven.solver.description)
        assert kinetic + potential == pytest.approx(before, abs=2e-8 * largest + 1e-12)
    assert len(described) > 2, 'no dead centre was passed'


def configuration(mechanism, rate=100.0):
    kind = next(name for name, cls in MECHANISM_KINDS.items() if type(mechanism) is cls)
    base = configure({'drive': 'torque'})
    base = with_linkage(base, kind=replace(base.only.kind, mechanism=kind))
    y = start(mechanism)
    crank = Solver(mechanism).state(y[: len(y) // 2]).position[0]
    drive = TorqueDrive(Motor(0.3, 0.01), 120 / math.pi, crank)
    if kind == 'wind_pump':
        base = load('wind_pump')
        slider = replace(mechanism.slider, position=1.0, velocity=0.4)
        mechanism = replace(mechanism, slider=slider)
        drive = TorqueDrive(Motor(1.0, 0.3), 30.0, 0.7)
    session = replace(base.session, rate_hz=rate)
    return with_linkage(base, mechanism=mechanism, drive=drive, session=session)


@every
def test_a_record_verifies_to_the_bit(name, tmp_path):
    path = tmp_path / 'run.mcap'
    record(configuration(MECHANISMS[name], 200.0), path, duration=3.0)
    verified(path)
    assert len({segment.description for segment in logged(path)[0].motions['']}) > 1


# The rocker crosses the direction in which angles jump from pi to -pi.
SEAMS = {f'{angle:g}': of(LIMITED['triple_rocker_far'], angle) for angle in (-3, 0.75)}


JUMPS = {**SEAMS, 'spinning': wind_pump((0.5, 0.6, 0.7), 'crossed'), 'pump': STRETCHED}


@pytest.mark.parametrize('name', JUMPS)
def test_states_next_to_the_jump_at_pi_close_the_loop_and_verify(name, tmp_path):
    """Includes a pump whose coupler has turned, and states that are seconds apart."""
    settings = configuration(JUMPS[name], 400.0 if name in SEAMS else 50.0)
    if name == 'spinning':
        settings = with_linkage(settings, drive=TorqueDrive(Motor(4.0, 0.2), -200.0, 0.7))
    simulator = Simulator(settings.only)
    motion = simulator.begin(0, record_steps)
    for tick in range(600 if name in SEAMS else 200):
        state = simulator.state(motion.at(simulator.ticks.elapsed(tick)))
        assert simulator.solver.structure.loop_residual(state) < 1e-13
        turning = state.position[2:3] if name in SEAMS else ()
        assert all(-math.pi < angle <= math.pi for angle in turning)
    record(settings, tmp_path / 'run.mcap', duration=3.0)
    slow = with_linkage(settings, session=replace(settings.session, rate_hz=0.7))
    record(slow, tmp_path / 'slow.mcap', duration=8.0)
    verified(tmp_path / 'run.mcap')
    verified(tmp_path / 'slow.mcap')


@pytest.mark.parametrize(
    ('forged', 'words'),
    [
        (Description(('crank',), 'open'), 'recomputed'),
        (Description(('slider',), 'open'), 'the mechanism has no description by slider'),
        (Description(('rocker',), 'sideways'), "assembly = 'sideways': must be one of open"),
    ],
)
def test_wrong_coordinates_in_a_segment_are_detected(forged, words, tmp_path, monkeypatch):
    """The segment has the wrong assembly, or coordinates that the mechanism does not have."""
    write = LogWriter.write_motion

    def write_forged(log, segment, linkage):
        write(log, replace(segment, description=segment.description and forged))

    monkeypatch.setattr(LogWriter, 'write_motion', write_forged)
    record(configuration(MECHANISMS['triple_rocker_far']), tmp_path / 'run.mcap', duration=2.0)
    assert words in report_of(tmp_path / 'run.mcap').difference


def test_live_run_compiles_the_programs_of_its_dead_centres_in_advance(monkeypatch):
    """Compiling during the run would delay hundreds of ticks."""
    program._tapes_of.cache_clear()  # as in a new process
    simulator = Simulator(configuration(of((2.03, 1.5, 1.2, 2.2), 0.31)).only)
    simulator.prepare_live()
    motion, compiled, compile_ = simulator.begin(0), [], Tape._compiled
    monkeypatch.setattr(
        Tape, '_compiled', lambda tape, *given: compiled.append(given) or compile_(tape, *given)
    )
    described = set()
    for tick in range(300):
        simulator.state(motion.at(tick * 10 * NS_PER_MS))
        described.add(motion.segment.description)
    assert len(described) > 2
    assert compiled == []


@pytest.mark.parametrize(
    'lengths',
    [
        (0.002, 0.50075, 0.50075, 1),  # an arc of 277 deg, with coupler and rocker almost in line
        (0.8, 1.1374, 0.2568, 1),  # half a turn from the middle of one arc to an end of the other
    ],
)
def test_crank_angle_does_not_jump_by_a_turn_past_dead_centres(lengths):
    mechanism = free(of(lengths, 2.0))
    for (low, high), speed in itertools.product(mechanism.reach().arcs, (4.0, -4.0)):
        driven = DrivenMechanism(Solver(mechanism), lambda speed: 0.0 * speed)
        steps = live_steps(driven, (low + 0.4 * (high - low), speed))
        for tick in range(1, 301):
            steps.advance(tick * 1e-2)
            crank = steps.driven.position(steps.phase, steps.pairs)
            assert low - 1e-9 < crank < high + 1e-9


def test_change_point_of_a_limited_crank_ends_the_motion_with_an_error():
    for name in sorted(WITH_CHANGE_POINT):
        with pytest.raises(MotionError, match='and the motion can continue') as ends:
            begun(live_steps, free(MECHANISMS[name])).advance(5.0)
        low, high = MECHANISMS[name].reach().arcs[0]
        (crank,) = ends.value.coordinates
        assert low - 1e-9 < low + (crank - low) % (2 * math.pi) < high + 1e-9


def test_motion_ends_at_a_singularity_without_other_coordinates(monkeypatch):
    mechanism = MECHANISMS['triple_rocker_far']
    structure = mechanism.structure()._replace(other_dyads=())
    monkeypatch.setattr(type(mechanism), 'other_coordinates', ())
    monkeypatch.setattr(type(mechanism), 'structure', lambda _: structure)
    with pytest.raises(
        MotionError, match=r'coupler and rocker are.* and the motion can'
    ) as raised:
        begun(live_steps, mechanism).advance(5.0)
    assert 0 < raised.value.time < 5


@given(
    st.floats(-12.5, 12.5), st.floats(-math.pi, math.pi), st.floats(-50, 50), st.floats(-50, 50)
)
def test_coordinates_survive_a_round_trip_through_messages(crank, coupler, speed, rate):
    """Converting angles to joint angles and back keeps the bits after the first time."""
    driven = DrivenMechanism(Solver(STRETCHED), lambda speed: 0.0 * speed)
    other = driven.described(Description(STRETCHED.other_coordinates, 'open'))
    y = legible(other, (crank, coupler, speed, rate))
    assert legible(other, y) == y
    assert math.remainder(y[1] - coupler, 2 * math.pi) == pytest.approx(0, abs=1e-14)
    assert y[3] == pytest.approx(rate, abs=1e-13)


def test_positions_out_of_reach_in_other_coordinates_are_refused():
    for name, places in (('offset_left', (9.0,)), ('pump', (1.5, 1.5))):
        mechanism = MECHANISMS[name]
        solver = Solver(mechanism, description=Description(mechanism.other_coordinates, 'open'))
        with pytest.raises(LinkageError, match=r'do(es)? not reach|cannot move at 9 m'):
            solver.driven_state(places, (0.0,) * len(places), 0.0)

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simpler models of the driving torque at a constant crank speed, as programs.

Terms are left out with their parameters; reduced models replace the coupler or the whole torque.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.equations import accelerations, balance, velocities
from linkage_ros.dynamics.model import Model
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.trees import Constants
from linkage_ros.formulas import ZERO, Opaque, Vector, total
from linkage_ros.model.load_kinds import LOADS
from linkage_ros.model.parts import Body
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array, Real, require_finite
from linkage_ros.quantities import build, flatten

STATIC = 'inertia'  # without it the masses resist no motion; weights and loads remain
# The parameters of each term, or their group; a term is there if one of them is not 0.
TERMS: dict[str, tuple[str, ...]] = {
    'gravity': ('gravity',),
    STATIC: ('crank.inertia', 'coupler.inertia', 'rocker.inertia'),
    'crank': ('crank.mass', 'crank.inertia'),
    'crank.inertia': ('crank.inertia',),
    'coupler': ('coupler.mass', 'coupler.inertia'),
    'coupler.inertia': ('coupler.inertia',),
    'rocker': ('rocker.mass', 'rocker.inertia'),
    'rocker.inertia': ('rocker.inertia',),
    'slider': ('slider.mass',),
    'rocker.torque': ('rocker.torque',),
    'rocker.damping': ('rocker.damping',),
    'rocker.stiffness': ('rocker.stiffness', 'rocker.rest_angle'),
    'slider.force': ('slider.force',),
    'slider.damping': ('slider.damping',),
    'slider.stiffness': ('slider.stiffness', 'slider.rest_position'),
    **{kind.group: (kind.group,) for kind in LOADS if kind.group},
}
_SLOW = 1e-6  # of the speed, at which inertia takes no torque
_COUNTED = ast.BinOp | ast.UnaryOp | ast.Compare | ast.Call | ast.IfExp


def terms(mechanism: Mechanism) -> dict[str, frozenset[str]]:
    """The terms of a mechanism, with their non-zero parameters."""
    values = flatten(mechanism)
    masses = any(values[x] for x in values if x.endswith(('.mass', '.inertia')))
    found = {name: _present(values, own) for name, own in TERMS.items()}
    # A link without mass has its inertia as its only term.
    twice = {name for name, own in found.items() if own == found.get(f'{name}.inertia')}
    return {
        name: own for name, own in found.items()
        if (own or (name == STATIC and masses)) and name not in twice
    }  # fmt: skip


def _present(values: Mapping[str, object], wanted: Iterable[str]) -> frozenset[str]:
    """The non-zero parameters of a term; a mass includes its centre."""
    own = _members(values, wanted)
    centers = {x.replace('.mass', '.center') for x in own if x.endswith('.mass') and values[x]}
    return frozenset(x for x in own | (centers & values.keys()) if numbers(values[x]))


def _members(values: Iterable[str], wanted: Iterable[str]) -> set[str]:
    """Selects parameters by name or by group."""
    return {x for x in values for name in wanted if x == name or x.startswith(f'{name}.')}


def numbers(value: object) -> int:
    """Counts the non-zero values of a parameter."""
    items = value if isinstance(value, (tuple, list)) else (value,)
    return sum(bool(item) and not isinstance(item, str) for item in items)


def without(mechanism: Mechanism, names: Iterable[str]) -> Mechanism:
    """Removes terms from a mechanism by setting their parameters to 0."""
    values = flatten(mechanism)
    gone = {x for name in names for x in _members(values, TERMS[name])}
    left = {name: value for name, value in values.items() if name not in gone}
    return build(type(mechanism), {'gravity': (0.0, 0.0)} | left)


def with_point_masses(mechanism: Any) -> Mechanism | None:
    """Moves the coupler's mass to its two pins, as parts of crank and output link.

    Args:
        mechanism: The mechanism.

    Returns:
        The mechanism with a massless coupler; None: it has no coupler between crank and output
        link, or the coupler has no mass or a centre of mass that is not between the pins.
    """
    coupler, output = getattr(mechanism, 'coupler', None), Solver(mechanism).links[-1]
    if coupler is None or not hasattr(mechanism, output) or not coupler.mass:
        return None
    share = coupler.center[0] / coupler.length
    if not 0 <= share <= 1:
        return None
    link, at_end = getattr(mechanism, output), share * coupler.mass
    if isinstance(link, Body):
        link = _with_mass_at_tip(link, at_end)
    else:
        link = replace(link, mass=link.mass + at_end)
    crank = _with_mass_at_tip(mechanism.crank, coupler.mass - at_end)
    bare = replace(coupler, mass=0.0, inertia=0.0)
    found: Mechanism = replace(mechanism, crank=crank, coupler=bare, **{output: link})
    return found


def _with_mass_at_tip(body: Body, added: float) -> Body:
    """Adds a point mass at the second pin of a link."""
    mass = body.mass + added
    if not mass:
        return body
    center, tip = complex(*body.center), complex(body.length)
    middle = (body.mass * center + added * tip) / mass
    inertia = body.inertia + body.mass * abs(center - middle) ** 2 + added * abs(tip - middle) ** 2
    return replace(body, mass=mass, inertia=inertia, center=(middle.real, middle.imag))


class TorqueProgram(NamedTuple):
    """A program for the driving torque.

    Attributes:
        scalar: Function of crank angle, rad, and constant speed, rad/s; returns the torque, N m,
            in a tuple.
        source: Python text of the program; with friction, of one round.
        takes_arrays: Whether it accepts arrays of angles.
    """

    scalar: Callable[..., tuple[Any]]
    source: str
    takes_arrays: bool = False


def _with_friction(mechanism: Mechanism, *, static: bool) -> TorqueProgram:
    """The torque of a mechanism with friction, found in rounds."""
    pace, values = (_SLOW if static else 1.0), flatten(mechanism)
    damped = {x: y / pace for x, y in values.items() if x.endswith('.damping')}  # type: ignore[operator]
    solver = Solver(build(type(mechanism), values | damped))
    return TorqueProgram(
        lambda angle, speed: (solver.state(angle, pace * speed).torque,),
        solver.source,
        takes_arrays=True,
    )


def torque_program(mechanism: Mechanism, *, static: bool = False) -> TorqueProgram:
    """The program of a mechanism's driving torque.

    Args:
        mechanism: The mechanism.
        static: Whether to leave out all inertia.

    Returns:
        The program; with friction, the repeated rounds.
    """
    if mechanism.joint_loads():
        return _with_friction(mechanism, static=static)
    return _torque(_static_torque if static else driving_torque, _model(mechanism))


def _torque(formula: Callable[..., Any], constants: Any) -> TorqueProgram:
    program = Program(formula, Constants(constants), ('angle', 'speed'))
    return TorqueProgram(program.scalar, program.source)


def inertia_program(mechanism: Mechanism) -> Program:
    """The torque of inertia alone, N m, from crank angle, speed and acceleration."""
    weightless = _model(mechanism)._replace(gravity=Vector(0.0, 0.0), loads=())
    return Program(driving_torque, Constants(weightless), ('angle', 'speed', 'acceleration'))


def _model(mechanism: Mechanism) -> Model:
    refuse = Opaque(require_finite)
    return Model.of(mechanism, mechanism.structure().links, mechanism.loop(), *(refuse,) * 3)


def torques(program: TorqueProgram, angles: Array, speed: float) -> Array:
    """The torques at crank angles, N m."""
    if program.takes_arrays:
        (found,) = program.scalar(angles, speed)
        return np.asarray(found)
    return np.array([program.scalar(angle, speed)[0] for angle in angles.tolist()])


def driving_torque(model: Model, angle: Real, speed: Real, *change: Real) -> tuple[Real]:
    """The driving torque at a crank angle and speed, N m, in a tuple."""
    pose = model.loop.pose((angle,))
    rates = velocities(pose, (speed,))
    return (balance(model, pose, rates, accelerations(pose, (speed,), change))[0],)


def _static_torque(model: Model, angle: Real, speed: Real) -> tuple[Real]:
    pose = model.loop.pose((angle,))
    rates = velocities(pose, (speed,))
    acting = [load.forces(pose.links, rates) for load in model.all_loads()]
    return (-total(x * pose.links[j].jacobian[0] for forces in acting for j, x in forces.items()),)


class _Series(NamedTuple):
    """A Fourier series of torques.

    Attributes:
        rate: Phase of the first harmonic per crank angle.
        mean: Mean torque, N m.
        waves: Amplitudes of cosine and sine of each harmonic, N m.
    """

    rate: float
    mean: float
    waves: tuple[Vector, ...]


def series_program(torques: Array, period: float, harmonics: int) -> TorqueProgram:
    """Replaces the driving torque at one speed by a Fourier series.

    Args:
        torques: Torques at even angles of one period, the first at 0, N m.
        period: Period, rad.
        harmonics: Number of harmonics.

    Returns:
        A program like that of `torque_program`, at any speed.
    """
    spectrum = np.fft.rfft(torques, norm='forward')
    parts = 2 * spectrum[1 : harmonics + 1]
    waves = tuple(Vector(float(x.real), float(-x.imag)) for x in parts)
    series = _Series(2 * math.pi / period, float(spectrum[0].real), waves)
    return _torque(_series_torque, series)


def _series_torque(series: _Series, angle: Real, _: Real) -> tuple[Real]:
    wave = Vector.at(series.rate * angle)  # Clenshaw's sum
    now = before = Vector(ZERO, ZERO)
    for amplitude in reversed(series.waves):
        now, before = amplitude + now * (2.0 * wave.x) - before, now
    return (series.mean + (now.x * wave.x - before.x) + now.y * wave.y,)


class _Table(NamedTuple):
    """A periodic table of torques.

    Attributes:
        per_angle: Nodes per crank angle, 1/rad.
        floor: The node before a place.
        value: Torque at a node, N m.
        slope: Difference to the next node, N m.
    """

    per_angle: float
    floor: Opaque
    value: Opaque
    slope: Opaque


def table_program(torques: Array, period: float) -> TorqueProgram:
    """Replaces the driving torque at one speed by a table with linear interpolation.

    Args:
        torques: Torques at the nodes, even angles of one period, the first at 0, N m.
        period: Period, rad.

    Returns:
        A program like that of `torque_program`, at any speed.
    """
    nodes, values = len(torques), torques.tolist()
    slopes = (np.roll(torques, -1) - torques).tolist()
    at, after = (Opaque(lambda i, row=row: row[i % nodes]) for row in (values, slopes))
    table = _Table(nodes / period, Opaque(math.floor), at, after)
    return _torque(_table_torque, table)


def _table_torque(table: _Table, angle: Real, _: Real) -> tuple[Real]:
    place = table.per_angle * angle
    node = table.floor(place)
    return (table.value(node) + table.slope(node) * (place - node),)


def operations(program: TorqueProgram) -> int:
    """Counts the operations of a run of a program, including guards, without their errors."""
    _, run = ast.parse(program.source).body
    parts = [x.test if isinstance(x, ast.If) else x for x in run.body]  # type: ignore[attr-defined]
    nodes = (node for part in parts for node in ast.walk(part) if isinstance(node, _COUNTED))
    return sum(
        # A minus before a number is no operation, nor is a result put together.
        not isinstance(getattr(x, 'operand', None), ast.Constant)
        and getattr(getattr(x, 'func', None), 'id', '') != 'new'
        for x in nodes
    )

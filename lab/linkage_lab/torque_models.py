# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Programs for simpler models of the driving torque at a constant crank speed.

A term is omitted by setting its parameters to 0. Reduced models replace the coupler by two point
masses, or the torque by a series or a table.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_lab.gaps import beside_change_points
from linkage_ros import Body, Mechanism, Solver
from linkage_ros.extensions import Constants, Program
from linkage_ros.formulas import ZERO, Array, Opaque, Real, Vector, total
from linkage_ros.internals import Model, acting_forces, torque
from linkage_ros.quantities import changed, flatten

STATIC = 'inertia'  # term of all inertia forces; without it, weights and loads remain
_BODY = 'mass', 'inertia', 'center'  # parameters of a link's body


def _known(mechanism: Mechanism) -> dict[str, tuple[str, ...]]:
    """Returns the parameters of each possible term, or their group.

    A load is one term with its name or, if that is another term, with the start of the names of
    its parameters.
    """
    groups = mechanism.part_groups()
    known = {
        'gravity': ('gravity',),
        STATIC: tuple(f'{group}.inertia' for group in groups.values()),
    }
    for name, group in groups.items():
        known[name] = tuple(f'{group}.{x}' for x in _BODY)
        known[f'{name}.inertia'] = (f'{group}.inertia',)
    loads = {load.label if load.name in known else load.name: load for load in mechanism.loads}
    return known | {term: (load.label,) for term, load in loads.items()}


def terms(mechanism: Mechanism) -> dict[str, dict[str, int]]:
    """Returns the terms of a mechanism, each with the number of nonzero values per parameter."""
    counts = _nonzero_values(mechanism)
    all_terms = {
        term: {name: counts[name] for name in _members(counts, parameters)}
        for term, parameters in _known(mechanism).items()
    }
    has_masses = any(name.endswith(('.mass', '.inertia')) for name in counts)
    found = dict[str, dict[str, int]]()
    for term, own in all_terms.items():
        # Masses have inertia forces, even if no link has a moment of inertia.
        exists = bool(own) or (term == STATIC and has_masses)
        # For a link without mass, 'crank' would repeat 'crank.inertia'.
        repeats = own == all_terms.get(f'{term}.inertia')
        if exists and not repeats:
            found[term] = own
    return found


def _nonzero_values(mechanism: Mechanism) -> dict[str, int]:
    """Returns the number of nonzero values of each parameter that has an effect, by name."""
    counts = {
        name: 0 if isinstance(value, str) else int(np.count_nonzero(value))  # type: ignore[call-overload]
        for name, value in flatten(mechanism).items()
    }
    massless_centers = {
        name
        for name in counts
        if name.endswith('.center') and not counts.get(name.replace('.center', '.mass'), 1)
    }
    return {name: n for name, n in counts.items() if n and name not in massless_centers}


def _members(values: Iterable[str], wanted: Iterable[str]) -> set[str]:
    """Selects parameters by name or by group."""
    return {x for x in values for name in wanted if x == name or x.startswith(f'{name}.')}


def without(mechanism: Mechanism, names: Iterable[str]) -> Mechanism:
    """Returns a copy of a mechanism in which the parameters of some terms are 0."""
    values, parameters = flatten(mechanism), _known(mechanism)
    left_out = [own for name in names for own in parameters.get(name, (name,))]
    zeros: dict[str, object] = {
        name: (0.0, 0.0) if isinstance(values[name], tuple) else 0.0
        for name in _members(values, left_out) if not name.startswith('loads.')
    }  # fmt: skip
    loads = tuple(load for load in mechanism.loads if load.label not in left_out)
    return cast('Mechanism', changed(replace(cast('Any', mechanism), loads=loads), zeros))


def with_point_masses(mechanism: Any) -> Mechanism | None:
    """Replaces the coupler by two point masses at its pins, added to crank and output link.

    Returns:
        The mechanism with a massless coupler; None if there is no coupler, or it has no mass, or
        its centre of mass is not between its pins.
    """
    coupler, output = (
        getattr(mechanism, 'coupler', None),
        mechanism.loop_structure().links[-1].name,  # the name of its part
    )
    if coupler is None or not (coupler.mass and 0 <= coupler.center[0] <= coupler.length):
        return None
    at_end = coupler.center[0] / coupler.length * coupler.mass
    found: Mechanism = replace(
        mechanism,
        crank=_with_mass_at_tip(mechanism.crank, coupler.mass - at_end),
        coupler=replace(coupler, mass=0.0, inertia=0.0),
        **{output: _with_mass_at_tip(getattr(mechanism, output), at_end)},
    )
    return found


def _with_mass_at_tip(link: Any, added: float) -> Any:
    """Adds a point mass at the second pin of a link, or to a slider."""
    mass = link.mass + added
    if not isinstance(link, Body) or not mass:
        return replace(link, mass=mass)
    center, tip = complex(*link.center), complex(link.length)
    middle = (link.mass * center + added * tip) / mass
    inertia = link.inertia + link.mass * abs(center - middle) ** 2 + added * abs(tip - middle) ** 2
    return replace(link, mass=mass, inertia=inertia, center=(middle.real, middle.imag))


class TorqueProgram(NamedTuple):
    """A program for the driving torque.

    Attributes:
        scalar: Function of the crank angle, rad, and the constant speed, rad/s, that returns the
            torque, N m, in a tuple.
        tape: Operations of the program, as in `Solver.tape`.
    """

    scalar: Callable[[float, float], tuple[Any]]
    tape: Any

    def torques(self, angles: Array, speed: float) -> Array:
        """Computes the torque, N m, at each crank angle, rad, for a constant speed, rad/s."""
        return np.array([self.scalar(angle, speed)[0] for angle in angles.tolist()])


def _program(
    formula: Callable[..., Any], constants: Any, arguments: Any = ('angle', 'speed')
) -> TorqueProgram:
    program = Program(formula, Constants(constants), arguments)
    return TorqueProgram(program.floats, program.tape)


def torque_program(mechanism: Mechanism, *, static: bool = False) -> TorqueProgram:
    """Compiles a program for a mechanism's driving torque at a constant crank speed.

    Args:
        mechanism: Mechanism to compile.
        static: Whether to omit all inertia forces.

    Returns:
        The program. With friction, it iterates to find the joint forces.
    """
    if mechanism.joint_loads():
        # At a millionth of the speed, the inertia torque is negligible; the damping is increased
        # to keep its torque.
        slowing, values = (1e-6 if static else 1.0), flatten(mechanism)
        damped = {x: y / slowing for x, y in values.items() if x.endswith('.damping')}  # type: ignore[operator]
        solver = Solver(changed(mechanism, damped))

        def torque_at(angle: float, speed: float) -> tuple[Any]:
            aside = float(beside_change_points(solver, angle))
            return (solver.state(aside, slowing * speed).torque,)

        return TorqueProgram(torque_at, solver.tape)
    model = Model.of(mechanism, mechanism.structure())
    return _program(_static_torque if static else torque, model, (('angle',), ('speed',)))


def _static_torque(model: Model, q: tuple[Real], u: tuple[Real]) -> tuple[Real]:
    """Computes the driving torque without inertia forces, by virtual power."""
    pose = model.loop.pose(q)
    rates = [link.jacobian[0] * u[0] for link in pose.links]
    acting = acting_forces(model, pose.links, rates)
    return (-total(x * pose.links[j].jacobian[0] for j, x in acting),)


def series_program(torques: Array, period: float, harmonics: int) -> TorqueProgram:
    """Replaces the driving torque at one speed by a Fourier series.

    Args:
        torques: Torques at evenly spaced angles of one period, the first at 0, N m.
        period: Period, rad.
        harmonics: Number of harmonics.

    Returns:
        A program with the signature of the full program; it ignores the speed.
    """
    mean, *others = np.fft.rfft(torques, norm='forward')[: harmonics + 1].tolist()
    waves = tuple(Vector(2 * x.real, -2 * x.imag) for x in others)
    return _program(_series_torque, (2 * math.pi / period, mean.real, waves))


def _series_torque(series: Any, angle: Real, _: Real) -> tuple[Real]:
    """Sums a Fourier series by Clenshaw's recurrence, from the highest harmonic down."""
    frequency, mean, amplitudes = series
    wave = Vector.at(frequency * angle)
    current = previous = Vector(ZERO, ZERO)
    for amplitude in reversed(amplitudes):
        current, previous = amplitude + current * (2.0 * wave.x) - previous, current
    return (mean + (current.x * wave.x - previous.x) + current.y * wave.y,)


def table_program(torques: Array, period: float) -> TorqueProgram:
    """Replaces the driving torque at one speed by a table with linear interpolation.

    Args:
        torques: Torques at evenly spaced nodes of one period, the first at 0, N m.
        period: Period, rad.

    Returns:
        A program with the signature of the full program; it ignores the speed.
    """
    nodes, values = len(torques), torques.tolist()
    steps = (np.roll(torques, -1) - torques).tolist()
    value = Opaque(lambda i: values[i % nodes])
    step = Opaque(lambda i: steps[i % nodes])
    return _program(_table_torque, (nodes / period, Opaque(math.floor), value, step))


def _table_torque(table: Any, angle: Real, _: Real) -> tuple[Real]:
    """Interpolates linearly in a table; see `table_program`."""
    nodes_per_angle, floor, value, step = table
    place = nodes_per_angle * angle
    node = floor(place)
    return (value(node) + step(node) * (place - node),)

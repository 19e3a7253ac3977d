# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pin forces, shaking force and shaking moment: Newton-Euler, body by body.

Virtual power gives the driving torque without them; they are computed only where asked for. The
coupler's balance of moments about A and the output link's about B0, or along its guide, give the
force at B; the pins A and A0 follow one after the other, and last the driving torque once more.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.dynamics.state import State, Vector, point_motion
from linkage_ros.errors import MechanismError
from linkage_ros.mechanisms.four_bar import FourBar
from linkage_ros.mechanisms.registry import Linkage
from linkage_ros.mechanisms.slider_crank import SliderCrank
from linkage_ros.mechanisms.structure import Structure
from linkage_ros.numeric import Real, functions_of


class Reactions(NamedTuple):
    """Forces in the joints, in the axes of base_link; floats or arrays, as in the state.

    Attributes:
        pins: Forces (x, y) at 'A0', of the frame on the crank, 'A', of the crank on the coupler,
            'B', of the coupler on the rocker or slider, and 'B0', of the frame on the rocker; N.
        guide_force: Of the guide on the slider, to the guide's left, N; None without a slider.
        shaking_force: (x, y) on the frame, of bearings, guide and the guide's resistance, N. An
            external force on the slider is in it, because it comes from outside the machine.
        shaking_moment: About A0 on the frame, the drive's own reaction included, N m.
        torque: The driving torque by the crank's balance of moments, N m.
    """

    pins: dict[str, Vector]
    guide_force: Real | None
    shaking_force: Vector
    shaking_moment: Real
    torque: Real


class _Load(NamedTuple):
    """What moves one body: the force through its centre of mass, and the couple."""

    center: Real
    force: Real
    couple: Real

    def moment(self, about: Real) -> Real:
        return self.couple + _cross(self.center - about, self.force)


def reactions(
    mechanism: Linkage, structure: Structure, state: State, transmission: Real
) -> Reactions:
    """The forces in the joints of a mechanism in motion.

    Args:
        mechanism: The mechanism.
        structure: How its links hang together.
        state: Its motion.
        transmission: Sine of the angle from the coupler to the rocker, or from the coupler to
            the normal of the guide, with the sign of the assembly; not 0.

    Returns:
        The forces. They grow without bound towards a change point or a limit of the crank.

    Raises:
        MechanismError: It is of another kind.
    """
    crank, coupler, *rocker = _loads(mechanism, structure, state)
    place = {
        name: _plane(point_motion(point, state).position)
        for name, point in structure.points.items()
    }
    # The coupler turns about A under the force at B: b x f = -moment.
    along = _direction(state.position[1])
    across = -coupler.moment(place['A']) / mechanism.coupler.length
    further: dict[str, Real] = {}
    if isinstance(mechanism, FourBar):
        turning = rocker[0].moment(place['B0']) / mechanism.rocker.length
        b = (across * _direction(state.position[2]) - turning * along) / transmission
        b0 = further['B0'] = rocker[0].force - b
        guide_force, on_frame = None, -b0
        moment = _cross(place['B0'], on_frame)
    elif isinstance(mechanism, SliderCrank):
        b, guide_force, on_frame = _at_slider(mechanism, state, (along, across), transmission)
        moment = _cross(place['B'], on_frame)
    else:
        raise MechanismError('joint forces are known of four-bars and slider-cranks alone')
    a = coupler.force + b
    a0 = crank.force + a
    torque = crank.moment(0j) + _cross(place['A'], a)
    shaking, pins = on_frame - a0, {'A0': a0, 'A': a, 'B': b, **further}
    return Reactions(
        {name: (force.real, force.imag) for name, force in pins.items()},
        guide_force,
        (shaking.real, shaking.imag),
        moment - torque,
        torque,
    )


def _loads(mechanism: Linkage, structure: Structure, state: State) -> list[_Load]:
    """What moves each of the bodies that turn."""
    gravity = complex(*mechanism.gravity)
    return [
        _Load(
            _plane(motion.position),
            body.mass * (_plane(motion.acceleration) - gravity),
            body.inertia * state.acceleration[body.link],
        )
        for body in structure.bodies
        for motion in [point_motion(body.center, state)]
    ]


def _at_slider(
    mechanism: SliderCrank, state: State, coupler: tuple[Real, Real], transmission: Real
) -> tuple[Real, Real, Real]:
    """The force at B, that of the guide, and that of guide and resistance on the frame.

    The coupler tells its direction, and the force at B across it.
    """
    (along, across), slider = coupler, mechanism.slider
    guide = _direction(mechanism.frame.angle)
    weight = slider.mass * complex(*mechanism.gravity)
    drag = slider.damping * state.velocity[2]
    pushed = slider.mass * state.acceleration[2] - _dot(guide, weight) + drag - slider.force
    pressed = (across - pushed * _cross(along, guide)) / transmission
    guide_force = -pressed - _dot(1j * guide, weight)
    on_frame = drag * guide - guide_force * (1j * guide)
    return pushed * guide + pressed * (1j * guide), guide_force, on_frame


def _direction(angle: Real) -> Real:
    functions = functions_of(angle)
    return functions.cos(angle) + 1j * functions.sin(angle)


def _plane(vector: Vector) -> Real:
    return vector[0] + 1j * vector[1]


def _cross(u: Real, v: Real) -> Real:
    return u.real * v.imag - u.imag * v.real


def _dot(u: Real, v: Real) -> Real:
    return u.real * v.real + u.imag * v.imag

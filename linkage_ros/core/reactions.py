# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pin forces, shaking force and shaking moment: Newton-Euler, body by body.

Virtual power gives the driving torque without them; they are computed only where asked for. The
coupler's balance of moments about A and the output link's about B0, or along its guide, give the
force at B; the pins A and A0 follow one after the other, and last the driving torque once more.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.core.mechanism import FourBar, Linkage
from linkage_ros.core.numeric import Real, functions_of
from linkage_ros.core.state import State, Vector, point_motion
from linkage_ros.core.structure import Structure


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
    """
    gravity = complex(*mechanism.gravity)
    crank, coupler, *rocker = (
        _Load(
            _plane(motion.position),
            body.mass * (_plane(motion.acceleration) - gravity),
            body.inertia * state.acceleration[body.link],
        )
        for body in structure.bodies
        for motion in [point_motion(body.center, state)]
    )
    place = {
        name: _plane(point_motion(point, state).position)
        for name, point in structure.points.items()
    }
    functions = functions_of(state.torque)
    along = functions.cos(state.position[1]) + 1j * functions.sin(state.position[1])
    # The coupler turns about A under the force at B: b x f = -moment.
    across = -coupler.moment(place['A']) / mechanism.coupler.length
    if isinstance(mechanism, FourBar):
        angle = state.position[2]
        toward = functions.cos(angle) + 1j * functions.sin(angle)
        turning = rocker[0].moment(place['B0']) / mechanism.rocker.length
        b = (across * toward - turning * along) / transmission
        b0 = rocker[0].force - b
        guide_force, on_frame = None, -b0
        moment = _cross(place['B0'], on_frame)
    else:
        joint, slider = structure.joints[2], mechanism.slider
        guide = functions.cos(joint.angle) + 1j * functions.sin(joint.angle)
        weight = slider.mass * gravity
        drag = slider.damping * state.velocity[2]
        pushed = slider.mass * state.acceleration[2] - _dot(guide, weight) + drag - slider.force
        pressed = (across - pushed * _cross(along, guide)) / transmission
        b = pushed * guide + pressed * (1j * guide)
        guide_force = -pressed - _dot(1j * guide, weight)
        on_frame = drag * guide - guide_force * (1j * guide)
        moment = _cross(place['B'], on_frame)
    a = coupler.force + b
    a0 = crank.force + a
    torque = crank.moment(0j) + _cross(place['A'], a)
    pins = {'A0': a0, 'A': a, 'B': b}
    if rocker:
        pins['B0'] = b0
    return Reactions(
        {name: (force.real, force.imag) for name, force in pins.items()},
        guide_force,
        ((on_frame - a0).real, (on_frame - a0).imag),
        moment - torque,
        torque,
    )


def _plane(vector: Vector) -> Real:
    return vector[0] + 1j * vector[1]


def _cross(u: Real, v: Real) -> Real:
    return u.real * v.imag - u.imag * v.real


def _dot(u: Real, v: Real) -> Real:
    return u.real * v.real + u.imag * v.imag

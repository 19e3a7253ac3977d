# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Describes a configuration in one line, and notes values whose unit is probably wrong."""

import math
from collections.abc import Iterator

from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.travel import travel
from linkage_ros.messages.joints import own_joints
from linkage_ros.settings.configuration import Configuration
from linkage_ros.settings.parameters import parameter_leaves

_LONG, _SHORT = 10.0, 1e-4  # m


def summary(configuration: Configuration, solver: Solver) -> str:
    """Describes mechanism and motion in one line.

    Args:
        configuration: Configuration of the run.
        solver: Solver of the configured mechanism.

    Returns:
        The line, without a newline.
    """
    words = [configuration.kind.mechanism, configuration.mechanism.assembly]
    if reach := solver.mobility:
        words.append('driven cylinder' if reach.slides else reach.grashof)
        if reach.turns_fully:
            words += travel(solver).words()
    drive = configuration.drive
    rate = f' at {configuration.session.rate_hz:g} Hz'
    moved = drive.words(solver.structure.driven_link)
    words.append(moved + ('' if drive.is_measured else rate))
    return ', '.join(words)


def notes(configuration: Configuration) -> list[str]:
    """Returns a line for each parameter that was probably given in another unit.

    Each line also states the value in the other unit. A measured crank whose zero is missing, and
    a mechanism that needs no torque at all, are also noted.
    """
    return [
        *_zero(configuration),
        *_angles(configuration),
        *_lengths(configuration),
        *_nothing(configuration),
    ]


def _zero(configuration: Configuration) -> Iterator[str]:
    structure, given = configuration.mechanism.structure(), configuration.joints
    link, joint = structure.driven_link, configuration.robot_joints[structure.driven]
    own = own_joints(structure.links, configuration.session.joint_prefix)[structure.driven]
    is_given = link.name in given and given[link.name].zero is not None
    if not configuration.drive.is_measured or joint.name == own.name or is_given:
        return
    meaning = 'a rod at 0 m' if link.slides else 'the direction of +x'
    yield (
        f"joints.{link.name}.zero is not given, so zero 0: {joint.name}'s 0 is taken as {meaning}"
    )


def _angles(configuration: Configuration) -> Iterator[str]:
    values = configuration.parameters()
    links = configuration.mechanism.structure().links
    turning = [f'joints.{link.name}.zero' for link in links if not link.slides]
    for name, quantity, _ in parameter_leaves(configuration.kind, values):
        value = values.get(name)
        is_angle = quantity.unit == 'rad' or name in turning
        if is_angle and isinstance(value, float) and abs(value) > 2 * math.pi:
            yield (
                f'{name} = {value:g} rad = {math.degrees(value) % 360:.4g} deg after whole turns; '
                f'did you mean {value:g} deg = {math.radians(value):.4g} rad?'
            )


def _lengths(configuration: Configuration) -> Iterator[str]:
    for name, value in configuration.parameters().items():
        if not name.endswith('.length') or not isinstance(value, float):
            continue
        if value > _LONG:
            yield f'{name} = {value:g} m; did you mean {value:g} mm = {value * 1e-3:g} m?'
        elif value < _SHORT:
            yield f'{name} = {value:g} m = {value * 1e3:g} mm; did you mean {value * 1e3:g} m?'


def _nothing(configuration: Configuration) -> Iterator[str]:
    mechanism = configuration.mechanism
    bodies = [(link.mass, link.inertia) for link in mechanism.structure().links]
    if not any(map(any, bodies)) and not mechanism.link_loads() and not mechanism.joint_loads():
        yield 'no link has a mass or an inertia, and there is no load or friction: the torque is 0'

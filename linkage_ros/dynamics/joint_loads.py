# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads that the forces in the joints make, such as dry friction, and that change these forces.

A round takes the motion under the loads of some forces, and makes a step towards the forces that
go with their own loads; see `linkage_ros.dynamics.force_search`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.equations import state, velocities
from linkage_ros.dynamics.force_search import Search, advanced
from linkage_ros.dynamics.model import Model
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.reactions import Joints, reactions
from linkage_ros.dynamics.state import State
from linkage_ros.dynamics.trees import Constants
from linkage_ros.formulas import ZERO, Vector
from linkage_ros.model.loads import Contact
from linkage_ros.model.pose import LinkPose
from linkage_ros.numeric import Real

_ROUNDS = 1000


class FoundLoad(NamedTuple):
    """The loads that joint forces cause, such as friction, as a `Load`.

    Attributes:
        inner: What pins between two links exert on each link, N m.
        outer: What the frame exerts on each: by its pins, N m, by its guide, N.
    """

    inner: tuple[Real, ...]
    outer: tuple[Real, ...]

    def forces(self, _links: Sequence[LinkPose], _rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        both = zip(self.inner, self.outer, strict=True)
        return {j: inner + outer for j, (inner, outer) in enumerate(both)}

    def resistance(self, _links: Sequence[LinkPose], _rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        return dict(enumerate(self.outer))


class Round(NamedTuple):
    """The outcome of one round.

    Attributes:
        state: The state under the load of the forces that were found before.
        reactions: The fields of `Reactions`, in its order.
        load: This load.
        search: What the next round begins with; where the forces are solved, the same again.
        left: 0 where they are solved, -1 where the mechanism locks itself, 1 elsewhere.
    """

    state: State
    reactions: tuple[Any, ...]
    load: FoundLoad
    search: Search
    left: Real


def round_program(constants: Constants, motion: Sequence[tuple[str, ...]]) -> Program:
    """The program of a round.

    Args:
        constants: A `Model` and `Joints`.
        motion: Names of the coordinates, of their rates and of their accelerations.

    Returns:
        `joint_load_round`, as a function of the motion and the fields of `Search`.
    """
    model, joints = constants.tree
    contacts = _contacts(model, joints, [0.0] * len(model.links))
    rows = (
        tuple(f'{word}_{i}_{contact.joint}' for i, contact in enumerate(contacts))
        for word in ('size', 'known')
    )
    return Program(joint_load_round, constants, (*motion, Search._fields[:3], *rows))


def joint_load_round(
    constants: tuple[Model, Joints],
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real],
    begun: tuple[Real, Real, Real],
    sizes: tuple[Real, ...],
    known: tuple[Real, ...],
) -> Round:
    """The motion under the loads that some forces make, and a step of Newton's method from these.

    Args:
        constants: The constants.
        q: Coordinates.
        u: Their rates.
        a: Their accelerations.
        begun: The first three fields of `Search`.
        sizes: `Search.sizes`, N.
        known: `Search.known`, N.

    Returns:
        The round.
    """
    model, joints = constants
    rates = velocities(model.loop.pose(tuple(q)), u)
    search, contacts = Search(*begun, sizes, known), _contacts(model, joints, rates)
    exert = functools.partial(_exerted, contacts, search.share, len(rates))
    load = exert(sizes)
    loaded = model._replace(loads=(*model.loads, load))
    found = reactions((loaded, joints), q, u, a)
    forces = _forces(constants, contacts, found)

    # The loads alone that a force of 1 N makes in one joint after the other: R_km.
    nothing: Any = ZERO
    links = tuple(link._replace(mass=nothing, inertia=nothing) for link in model.links)
    weightless = model._replace(links=links, gravity=Vector(ZERO, ZERO))
    units = [[1.0 if k == m else ZERO for k in range(len(sizes))] for m in range(len(sizes))]
    alone = [weightless._replace(loads=(exert(unit),)) for unit in units]
    slopes = [_forces(constants, contacts, reactions((x, joints), q, u, a)) for x in alone]
    ahead, left = advanced(search, forces, slopes)
    return Round(state(loaded, q, u, a), found, load, ahead, left)


def _contacts(model: Model, joints: Joints, rates: Sequence[Real]) -> list[Contact]:
    loads = model.joint_loads
    return [x for load in loads for x in load.contacts(joints.pins, model.links, rates)]


def _exerted(
    contacts: Sequence[Contact], share: Real, links: int, sizes: Sequence[Real]
) -> FoundLoad:
    """The load that forces of some magnitudes make, with a share of the coefficients."""
    inner, outer = [ZERO] * links, [ZERO] * links
    for contact, size in zip(contacts, sizes, strict=True):
        row = inner if contact.is_inner else outer
        for j, lever in contact.levers.items():
            row[j] += lever * (share * size)
    return FoundLoad(tuple(inner), tuple(outer))


def _forces(
    constants: tuple[Model, Joints], contacts: Sequence[Contact], found: tuple[Any, ...]
) -> list[Vector]:
    """The forces in the joints of contacts."""
    (model, joints), (pins, guides, *_) = constants, found
    sliding = (link.name for link in model.links if link.slides)
    forces = dict(zip((pin.name for pin in joints.pins), pins, strict=True))
    forces |= {name: Vector(x, ZERO) for name, x in zip(sliding, guides, strict=True)}
    return [forces[contact.joint] for contact in contacts]


def settle(
    run: Callable[..., Round],
    count: int,
    shape: tuple[int, ...],
    refuse: Callable[[Any], object],
) -> Round:
    """Repeats rounds until the forces are solved.

    Args:
        run: `joint_load_round` of one motion, or of an array of them: a function of the numbers of
            a `Search`.
        count: How many these are.
        shape: Shape of an array of motions; empty: it is one.
        refuse: Called with where the mechanism locks itself, True or an array; raises an error.

    Returns:
        The last round. What is solved stays, so that arrays have the bits of their states.

    Raises:
        AssertionError: `refuse` has not raised an error.
    """
    search: list[Real] = [1.0, 0.0, math.inf, *[0.0] * (count - 3)]
    if shape:  # one program for all rounds
        search = [np.full(shape, value) for value in search]
    for _ in range(_ROUNDS):
        found = run(*search)
        left = np.asarray(found.left)
        if not left.any():
            return found
        if (left < 0).any():
            break
        *begun, sizes, known = found.search
        search = [*begun, *sizes, *known]
    refuse(left != 0)
    raise AssertionError('refuse must raise an error')

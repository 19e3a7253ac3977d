# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction, which depends on joint forces and changes them.

For a given motion, the forces are linear in the frictions: F_k = F0_k + sum_m R_km s_m, where s_m
is the magnitude of the force in joint m, and R_km holds the coefficient of friction. Newton's
method solves s_k = |F_k|. Its matrix, 1_km - F_k . R_km / |F_k|, has the determinant 1 without
friction. Several solutions may exist; the right one develops from the forces without friction as
the coefficients grow, and the determinant stays positive along this path. Where the determinant
reaches 0, the forces become infinite or cease to exist: the mechanism is self-locking.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.equations import Model, determinant, solved, state, velocities
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.reactions import reactions
from linkage_ros.dynamics.state import State
from linkage_ros.dynamics.trees import Constants
from linkage_ros.formulas import ZERO, Vector, dot, number, sqrt, where
from linkage_ros.model.friction import Friction
from linkage_ros.model.pose import LinkPose
from linkage_ros.numeric import Real

_PART = 1e-12  # of the largest force, by which a state that is solved still changes
_ROUNDING = 1e-6  # the same where rounding errors no longer let the change shrink
_SINGULAR = 1e-12  # a determinant whose digits are all wrong
_STEP = 1e-9  # the smallest step of the coefficients, as a share of them
_ROUNDS = 1000


class Coefficients(NamedTuple):
    """The constants of friction.

    Attributes:
        arm: Coefficient times radius of the pins, m; ZERO: no friction there.
        guide: Coefficient of the guide; ZERO: no friction there.
    """

    arm: Real
    guide: Real


class FrictionLoad(NamedTuple):
    """Known friction as a load; see `linkage_ros.model.loads.Load`.

    Attributes:
        inner: Friction of the pins between links, on each link, N m.
        outer: Friction of the frame on each link: of its pins, N m, of its guide, N.
    """

    inner: tuple[Real, ...]
    outer: tuple[Real, ...]

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        del links, rates
        both = zip(self.inner, self.outer, strict=True)
        return {j: inner + outer for j, (inner, outer) in enumerate(both)}

    def resistance(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        del links, rates
        return dict(enumerate(self.outer))

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`: there is none."""
        del links
        return ZERO


class Contact(NamedTuple):
    """A joint with friction.

    Attributes:
        is_inner: Whether it is a pin between two links that turn.
        levers: Friction on links per force in the joint, m; for a sliding link, dimensionless.
    """

    is_inner: bool
    levers: dict[int, Real]


class Search(NamedTuple):
    """The progress of the search for the forces of a state.

    Attributes:
        share: Share of the coefficients at which they are sought, from 0 to 1.
        solved: Largest share at which they are solved.
        change: Their change in the last round, N; inf before the first round of a share.
        sizes: Current magnitudes of the forces in the joints with friction, N.
        known: Magnitudes at the solved share, N.
    """

    share: Real
    solved: Real
    change: Real
    sizes: tuple[Real, ...]
    known: tuple[Real, ...]


class Round(NamedTuple):
    """The outcome of one round.

    Attributes:
        state: The state under the friction of the previous forces.
        reactions: The fields of `Reactions`, in its order.
        friction: This friction.
        search: Input of the next round; unchanged once the forces are solved.
        left: 0 if they are solved, -1 if the mechanism is self-locking, else 1.
    """

    state: State
    reactions: tuple[Any, ...]
    friction: FrictionLoad
    search: Search
    left: Real


def friction_program(
    model: Model, friction: Friction, motion: Sequence[tuple[str, ...]]
) -> Program:
    """The program of a round.

    Args:
        model: The constants of the mechanism.
        friction: The coefficients.
        motion: Names of the coordinates, of their rates and of their accelerations.

    Returns:
        `friction_round`, as a function of the motion and the fields of `Search`.
    """
    coefficients = Coefficients(friction.pin * friction.pin_radius, friction.guide)
    names = [pin.name for pin in model.pins] if coefficients.arm else []
    names += ['guide'] if coefficients.guide else []
    rows = (tuple(f'{word}_{name}' for name in names) for word in ('size', 'known'))
    arguments = (*motion, Search._fields[:3], *rows)
    return Program(friction_round, Constants((model, coefficients)), arguments)


def friction_round(
    constants: tuple[Model, Coefficients],
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real],
    begun: tuple[Real, Real, Real],
    sizes: tuple[Real, ...],
    known: tuple[Real, ...],
) -> Round:
    """Solves the motion with the friction of given forces; makes one step of Newton's method.

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
    model, coefficients = constants
    rates = velocities(model.loop.pose(tuple(q)), u)
    search = Search(*begun, sizes, known)
    contacts = _contacts(model, coefficients, rates)
    exert = functools.partial(_friction, contacts, search.share, len(rates))
    load = exert(sizes)
    rubbing = model._replace(loads=(*model.loads, load))
    found = reactions(rubbing, q, u, a)
    forces = _in_contacts(coefficients, found)

    # The friction alone, of a force of 1 N in one joint after the other: R_km.
    nothing: Any = ZERO
    links = tuple(link._replace(mass=nothing, inertia=nothing) for link in model.links)
    weightless = model._replace(links=links, gravity=Vector(ZERO, ZERO))
    units = [[1.0 if k == m else ZERO for k in range(len(sizes))] for m in range(len(sizes))]
    alone = [weightless._replace(loads=(exert(unit),)) for unit in units]
    slopes = [_in_contacts(coefficients, reactions(other, q, u, a)) for other in alone]
    ahead, left = _advanced(search, forces, slopes)
    return Round(state(rubbing, q, u, a), found, load, ahead, left)


def _contacts(model: Model, coefficients: Coefficients, rates: Sequence[Real]) -> list[Contact]:
    """The joints with friction, pins first."""
    contacts = []
    for pin in model.pins if coefficients.arm is not ZERO else ():
        # A link that slides does not turn: its guide passes the couple on to the frame.
        first, *others = (
            j for j in (pin.second, pin.first) if j is not None and not model.links[j].slides
        )
        apart = rates[first] - (rates[others[0]] if others else ZERO)
        lever = coefficients.arm * _sign(apart)
        contacts.append(Contact(bool(others), {first: -lever, **dict.fromkeys(others, lever)}))
    for j, link in enumerate(model.links):
        if link.slides and coefficients.guide is not ZERO:
            contacts.append(Contact(False, {j: -(coefficients.guide * _sign(rates[j]))}))
    return contacts


def _sign(rate: Real) -> Real:
    return where(rate > 0, 1.0, where(rate < 0, -1.0, 0.0))


def _friction(
    contacts: Sequence[Contact], share: Real, links: int, sizes: Sequence[Real]
) -> FrictionLoad:
    """The friction of forces of given magnitudes, at a share of the coefficients."""
    inner, outer = [ZERO] * links, [ZERO] * links
    for contact, size in zip(contacts, sizes, strict=True):
        row = inner if contact.is_inner else outer
        for j, lever in contact.levers.items():
            row[j] += lever * (share * size)
    return FrictionLoad(tuple(inner), tuple(outer))


def _in_contacts(coefficients: Coefficients, found: tuple[Any, ...]) -> list[Vector]:
    """The forces in the joints with friction, in the order of `_contacts`."""
    pins, guides, *_ = found
    return [
        *(pins if coefficients.arm is not ZERO else ()),
        *(Vector(x, ZERO) for x in guides if coefficients.guide is not ZERO),
    ]


def _advanced(
    search: Search, forces: Sequence[Vector], slopes: Sequence[Sequence[Vector]]
) -> tuple[Search, Real]:
    """The search after a step of Newton's method.

    Args:
        search: The search before it.
        forces: F_k.
        slopes: R_km in the order [m][k].

    Returns:
        The search, and `Round.left`.
    """
    sizes = [sqrt(dot(force, force)) for force in forces]
    matrix = [
        [
            (1.0 if k == m else ZERO) - dot(forces[k], row[k]) / where(sizes[k] > 0, sizes[k], 1.0)
            for m, row in enumerate(slopes)
        ]
        for k in range(len(forces))
    ]
    lacking = [found - size for found, size in zip(sizes, search.sizes, strict=True)]
    whole = number(determinant(matrix))
    steps = solved(matrix, lacking, where(whole > _SINGULAR, whole, 1.0))
    return _next(search, steps, whole, _largest(sizes))


def _next(
    search: Search, steps: Sequence[Real], whole: Real, largest: Real
) -> tuple[Search, Real]:
    """The search of the next round, and `Round.left`.

    Args:
        search: Input of this round.
        steps: Newton's steps, N.
        whole: Determinant of the matrix.
        largest: Largest force, N.
    """
    share, change = search.share, _largest([abs(step) for step in steps])
    shrinks = change < 0.5 * search.change
    close = change <= where(shrinks, _PART, _ROUNDING) * largest

    def case(is_close: Real, shrinks_only: Real, fails: Real) -> Real:
        otherwise = where(shrinks, shrinks_only, fails)
        return where(whole > _SINGULAR, where(close, is_close, otherwise), fails)

    grown = share - search.solved
    further, nearer = share + 2.0 * grown, share - 0.5 * grown
    further = where(further < 1, further, 1.0)
    sizes = [size + step for size, step in zip(search.sizes, steps, strict=True)]
    ahead = Search(
        case(further, share, nearer),
        case(share, search.solved, search.solved),
        case(where(share < 1, math.inf, search.change), change, math.inf),
        tuple(
            case(where(share < 1, size, before), size, known)
            for size, before, known in zip(sizes, search.sizes, search.known, strict=True)
        ),
        tuple(case(size, known, known) for size, known in zip(sizes, search.known, strict=True)),
    )
    left = case(where(share < 1, 1.0, 0.0), 1.0, where(grown > _STEP, 1.0, -1.0))
    return ahead, left


def _largest(values: Sequence[Real]) -> Real:
    return functools.reduce(lambda x, y: where(x > y, x, y), values)


def settle(
    run: Callable[..., Round],
    count: int,
    shape: tuple[int, ...],
    refuse: Callable[[Any], object],
) -> Round:
    """Repeats rounds until the forces are solved.

    Args:
        run: `friction_round` of one motion, or of an array of them: a function of the numbers of
            a `Search`.
        count: Number of these numbers.
        shape: Shape of an array of motions; empty: one motion.
        refuse: Called with True, or an array, where the mechanism is self-locking; raises an
            error.

    Returns:
        The last round. Solved states do not change, so that arrays have the bits of single states.

    Raises:
        AssertionError: `refuse` did not raise an error.
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

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction: the forces in the joints make it, and it changes these forces.

Both are found together by fixed-point iteration from the motion without friction: the forces in
the joints give the friction, which gives these forces anew. Where these do not settle, the
mechanism locks itself, or is near to it, and is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.equations import Model, state, velocities
from linkage_ros.dynamics.reactions import reactions
from linkage_ros.dynamics.state import State
from linkage_ros.formulas import ZERO, number, sqrt, where
from linkage_ros.model.pose import LinkPose
from linkage_ros.numeric import Real

_PART = 1e-12  # of the largest force, by which a state that is solved still changes
_ROUNDS = 100
_PATIENCE = 5  # rounds after which the change must be smaller


class Coefficients(NamedTuple):
    """The constants of friction.

    Attributes:
        arm: Coefficient times radius of the pins, m; ZERO: no friction there.
        guide: Coefficient of the guide; ZERO: likewise.
    """

    arm: Real
    guide: Real


class FrictionLoad(NamedTuple):
    """Friction that is known, as a load; see `linkage_ros.model.loads.Load`.

    Attributes:
        inner: What the pins between two links exert on each link, N m.
        outer: What the frame exerts on each: by its pins, N m, by its guide, N.
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


class Round(NamedTuple):
    """The outcome of one round.

    Attributes:
        state: The state with the friction that was given.
        reactions: The fields of `Reactions`, in its order.
        sizes: Magnitudes of the forces in pins and guides, N.
        friction: What these forces make.
    """

    state: State
    reactions: tuple[Any, ...]
    sizes: tuple[Real, ...]
    friction: FrictionLoad


def friction_round(
    constants: tuple[Model, Coefficients],
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real],
    inner: tuple[Real, ...],
    outer: tuple[Real, ...],
) -> Round:
    """The motion under a friction, and the friction that its forces make."""
    model, coefficients = constants
    model = model._replace(loads=(*model.loads, FrictionLoad(inner, outer)))
    found = state(model, q, u, a)
    forces, guides, *others = reactions(model, q, u, a)
    rates = velocities(model.loop.pose(tuple(q)), u)
    sizes = [sqrt(force.x * force.x + force.y * force.y) for force in forces]
    pushes, frame = [ZERO] * len(rates), [ZERO] * len(rates)
    for pin, size in zip(model.pins, sizes, strict=True):
        # A link that slides does not turn: its guide passes the couple on to the frame.
        turning = [
            j for j in (pin.first, pin.second) if j is not None and not model.links[j].slides
        ]
        row = pushes if len(turning) == 2 else frame
        apart = rates[turning[-1]] - (rates[turning[0]] if len(turning) == 2 else ZERO)
        couple = coefficients.arm * (size * _sign(apart))
        row[turning[-1]] -= couple
        if len(turning) == 2:
            row[turning[0]] += couple
    sliding = [j for j, link in enumerate(model.links) if link.slides]
    for j, force in zip(sliding, guides, strict=True):
        sizes.append(abs(force))
        frame[j] -= coefficients.guide * (sizes[-1] * _sign(rates[j]))
    return Round(
        found,
        (forces, guides, *others),
        tuple(sizes),
        FrictionLoad(tuple(map(number, pushes)), tuple(map(number, frame))),
    )


def _sign(rate: Real) -> Real:
    return where(rate > 0, 1.0, where(rate < 0, -1.0, 0.0))


def settle(run: Callable[..., Round], links: int, refuse: Callable[[Any], object]) -> Round:
    """Repeats rounds until nothing changes.

    Args:
        run: `friction_round` of one motion, or of an array of them: a function of what the
            friction exerts, two numbers for each link.
        links: Number of links.
        refuse: Called with where it does not settle, True or an array; raises an error.

    Returns:
        The last round.

    Raises:
        AssertionError: `refuse` has not raised an error.
    """
    given: list[Real] = [0.0] * (2 * links)
    sizes: Sequence[Real] = ()
    changes: list[Any] = []
    settled: Any = False
    for _ in range(_ROUNDS):
        found = run(*given)
        before, sizes = sizes, found.sizes
        if before:
            changes.append(_largest([abs(x - y) for x, y in zip(sizes, before, strict=True)]))
            settled = settled | (changes[-1] <= _PART * _largest(sizes))
            if _all(settled):
                return found
        if len(changes) > _PATIENCE:
            shrinks = settled | (changes[-1] < changes[-1 - _PATIENCE])
            if not _all(shrinks):
                refuse(np.logical_not(shrinks))
        # What has settled stays: the bits of an array are those of its states one by one.
        made = (*found.friction.inner, *found.friction.outer)
        given = [
            new if isinstance(settled, bool) else np.where(settled, old, new)
            for old, new in zip(given, made, strict=True)
        ]
    refuse(np.logical_not(settled))
    raise AssertionError('refuse must raise an error')


def _largest(values: Sequence[Real]) -> Real:
    return max(values) if isinstance(values[0], float) else np.max(np.array(values), axis=0)


def _all(holds: Any) -> bool:
    return holds if isinstance(holds, bool) else bool(np.all(holds))

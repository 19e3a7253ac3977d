# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Situations in which methods fail, generated from a seed.

Each is a set of cases: a mechanism, its motion, crank angles in the order in which they are
asked for, and a first guess for methods that want one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.lab.methods.chain import Task, make_task
from linkage_ros.lab.methods.linkages import (
    Random,
    any_assembly,
    four_bar,
    limited,
    other_assembly,
    slider_crank,
    turning,
    with_change_point,
)
from linkage_ros.lab.methods.loop import Linkage
from linkage_ros.model.four_bar import FourBar

_SEED = 20_261_121


class Case(NamedTuple):
    """One mechanism in a situation.

    Attributes:
        task: The mechanism and its motion.
        cranks: Crank angles in turn, rad.
        lengths: Decimal texts that the lengths stand for (`Reference`); None: the doubles.
    """

    task: Task
    cranks: tuple[float, ...]
    lengths: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Situation:
    """A kind of trouble.

    Attributes:
        name: As charts and docs call it.
        words: What it is.
        generate: Makes the cases.
        exists: Whether there is a state to be found; otherwise the right answer is a refusal.
    """

    name: str
    words: str
    generate: Callable[[Random, int], Iterator[Case]]
    exists: bool = True

    def cases(self, count: int) -> list[Case]:
        """As many cases, the same ones at every call."""
        seed = [_SEED, *self.name.encode()]
        return list(self.generate(np.random.default_rng(seed), count))


def _case(
    mechanism: Linkage, cranks: tuple[float, ...], lengths: tuple[str, ...] | None = None
) -> Case:
    """The first guess is read off at the first angle."""
    return Case(make_task(mechanism, cranks[0]), cranks, lengths)


def _turn(steps: int = 48, turns: int = 1) -> tuple[float, ...]:
    """Even angles, the first half a step after 0."""
    return tuple((i + 0.5) * 2 * math.pi / steps for i in range(steps * turns))


def _passing(*extra: float) -> tuple[float, ...]:
    """Two turns in even steps, begun a quarter of a turn before 0, and further angles."""
    even = (-math.pi / 2 + angle for angle in _turn(turns=2))
    return tuple(sorted((*even, *extra)))


def _ordinary(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        yield _case(turning(random), _turn())


def _hit(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        mechanism = with_change_point(random)
        yield _case(mechanism, (-0.3, -0.2, -0.1, 0.0, -0.0, 1e-300))


def _passed(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        yield _case(with_change_point(random), _passing())


def _near(random: Random, count: int) -> Iterator[Case]:
    for i in range(count):
        angle, gap = float(random.uniform(-3, 3)), 10.0 ** -float(random.uniform(11, 13))
        r, b = (float(x) for x in random.uniform((0.2, 0.5), (0.4, 0.9)))
        d = r + gap if i % 2 else r + float(random.uniform(0.1, 0.4))
        c = b if i % 2 else d - r + b - gap
        mechanism = four_bar((r, b, c, d), any_assembly(random), angle)
        aside = [sign * 10.0**power for power in range(-14, 0) for sign in (-1, 1)]
        yield _case(mechanism, tuple(sorted(angle + x for x in (*aside, 0.0))))


def _dead_centre(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        mechanism = limited(random)
        start, end = Solver(mechanism).reach.arcs[0]
        middle, goal, inward = (start + end) / 2, end, -1.0
        if random.random() < 0.5:
            goal, inward = start, 1.0
        # In steps from the middle of the arc, as a motion would come there.
        walk = np.linspace(middle, goal + inward * 1e-2, 40, endpoint=False)
        near = [goal + inward * 10.0**-k for k in range(2, 7)]
        yield _case(mechanism, (*map(float, walk), *near))


def _no_assembly(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        mechanism = limited(random)
        start, end = Solver(mechanism).reach.arcs[0]
        beyond = tuple(float(end + x) for x in random.uniform(0.01, 0.9, 8) * 0.1)
        position = Solver(mechanism).state((start + end) / 2).position
        yield Case(Task(mechanism, (position[1], position[2])), beyond)


def _denominator(random: Random, count: int) -> Iterator[Case]:
    yield _case(slider_crank(0.1, 0.3, 0.0), (0.0, math.pi))
    while count > 1:
        mechanism = turning(random)
        if not isinstance(mechanism, FourBar):
            continue
        # Where the rocker of one assembly points against the frame its half angle's tangent is
        # infinite: the quadratic term vanishes, and the other assembly's solution is 0/0.
        other = other_assembly(mechanism)
        cranks, angle = np.linspace(0, 2 * math.pi, 721), mechanism.frame.angle
        turned = Solver(other).state(cranks).position[2] - angle
        sine, cosine = np.sin(turned), np.cos(turned)
        (places,) = np.nonzero((sine[:-1] * sine[1:] < 0) & (cosine[:-1] < 0))
        for place in places:
            low, high = float(cranks[place]), float(cranks[place + 1])
            yield _case(mechanism, (_root(other, angle, low, high),))
            count -= 1


def _root(mechanism: Linkage, angle: float, low: float, high: float) -> float:
    """Where the rocker points against the frame, by bisection."""
    solver = Solver(mechanism)

    def sine(crank: float) -> float:
        return math.sin(solver.state(crank).position[2] - angle)

    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if sine(low) * sine(middle) > 0 else (low, middle)
    return low


def _wrong_guess(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        mechanism = turning(random)
        other = other_assembly(mechanism)
        cranks = _turn()
        position = Solver(other).state(cranks[0]).position
        yield Case(Task(mechanism, (position[1], position[2])), cranks)


def _few_steps(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        d = float(random.uniform(0.1, 0.15))
        lengths = (float(random.uniform(0.5, 0.6)), float(random.uniform(0.35, 0.45)), 0.55, d)
        yield _case(four_bar(lengths, any_assembly(random)), _turn(steps=5, turns=2))


def _long_crank(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        r, angle = float(random.uniform(0.3, 0.6)), float(random.uniform(-3, 3))
        mechanism = slider_crank(r, 0.25, 0.05, any_assembly(random), angle)
        start, end = Solver(mechanism).reach.arcs[0]
        cranks = np.linspace(start, end, 34)[1:-1]
        yield _case(mechanism, tuple(map(float, cranks)))


def _equal(random: Random, count: int) -> Iterator[Case]:
    for i in range(count):
        x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
        lengths = ((x, x, x, x), (x, y, y, x), (x, y, x, y))[i % 3]
        yield _case(four_bar(lengths, any_assembly(random)), _passing(0.0, 1e-9))


_DECIMALS = (
    ('0.1', '0.3', '0.4', '0.2'), ('0.1', '0.7', '0.8', '0.2'), ('0.3', '0.6', '0.7', '0.4'),
    ('0.1', '0.2', '0.3', '0.2'), ('0.7', '0.9', '1.1', '0.9'),
)  # fmt: skip


def _decimals(random: Random, count: int) -> Iterator[Case]:
    for i in range(count):
        texts = _DECIMALS[i % len(_DECIMALS)]
        lengths = tuple(map(float, texts))
        yield _case(four_bar(lengths, any_assembly(random)), _passing(1e-9, 1e-6, 1e-3), texts)


def _scaled(size: float) -> Callable[[Random, int], Iterator[Case]]:
    def generate(random: Random, count: int) -> Iterator[Case]:
        for _ in range(count):
            lengths = (0.1 * size, 0.315 * size, 0.5 * size, 0.425 * size)
            angle = float(random.uniform(-3, 3))
            yield _case(four_bar(lengths, any_assembly(random), angle), _turn())

    return generate


def _long_run(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        turns = 2 * math.pi * 1e9
        yield _case(turning(random), tuple(turns + x for x in _turn()))


def _at_rest(random: Random, count: int) -> Iterator[Case]:
    for _ in range(count):
        case = _case(turning(random), _turn())
        yield case._replace(task=replace(case.task, speed=0.0))


SITUATIONS = (
    Situation('ordinary', 'random linkages that turn fully, far from change points', _ordinary),
    Situation('change point hit', 'all links in one line, to the last bit', _hit),
    Situation('change point passed', 'two turns through it, in both assemblies', _passed),
    Situation(
        'near a change point',
        'missed by 1e-11 to 1e-13 m, angles down to 1e-14 rad from it, and on it',
        _near,
    ),
    Situation(
        'dead centre',
        'of a crank that cannot turn fully, come up to in steps, to 1e-6 rad',
        _dead_centre,
    ),
    Situation('no assembly', 'a crank turned beyond its reach', _no_assembly, exists=False),
    Situation(
        'half-angle denominator',
        'the coefficient of the quadratic term is zero but for rounding',
        _denominator,
    ),
    Situation('wrong first guess', "the other assembly's position", _wrong_guess),
    Situation('few steps', 'a linkage of turning links asked five times a turn', _few_steps),
    Situation('crank longer than rod', 'slider-cranks that swing', _long_crank),
    Situation('equal lengths', 'rhombi, kites, parallelograms, with both change points', _equal),
    Situation(
        'lengths in decimals',
        'a change point is meant, but 0.2 + 0.3 - 0.1 - 0.4 is not 0',
        _decimals,
    ),
    Situation('tiny links', 'a micrometre', _scaled(1e-6)),
    Situation('huge links', 'a thousand kilometres', _scaled(1e6)),
    Situation('long run', 'after 1e9 turns', _long_run),
    Situation('crank at rest', 'a crank that only begins to move', _at_rest),
)

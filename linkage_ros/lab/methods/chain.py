# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A method from the crank angle to position, velocity, acceleration and torque.

A method does one stage. The position before it is the package's own, as unit vectors; a position
is followed by the 2x2 solve of documents 1 and 4, because rates that belong to it have to come
from it; and the torque is the package's own sum. So every method has a point in each chart that
its stage reaches.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.dynamics.equations import balance
from linkage_ros.dynamics.model import Model
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.trees import Constants
from linkage_ros.formulas import Opaque, Vector
from linkage_ros.lab.methods import stages
from linkage_ros.lab.methods.linkages import Linkage
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import OPEN
from linkage_ros.numeric import Array, Real, require_finite

QUANTITIES = ('position', 'rate', 'acceleration', 'torque')
STATE, POSITION, RATES, MOTION = 'state', 'position', 'rates', 'motion'
ONE, BATCH = 'one at a time', 'batch'
# What a method of a stage itself computes.
OWN = {STATE: QUANTITIES, POSITION: QUANTITIES[:1], RATES: QUANTITIES[1:3]}

Function: TypeAlias = Callable[[Real], tuple[Real, ...]]
Setting: TypeAlias = dict[str, float]


@dataclass(frozen=True)
class Method:
    """One way to solve a stage.

    Attributes:
        name: As charts and docs call it.
        stage: What it computes: 'state' (all of it), 'position', 'rates' or 'motion'.
        needs: What it asks for beside the lengths.
        source: Where it is described, to the equation.
        solve: The formula of its stage, as in `stages`; of a motion, a function of the initial
            value problem and a setting that begins to follow it.
        settings: The settings for the accuracy chart, from coarse to fine.
        steady: The setting for the stability chart: the best practical one.
        modes: 'one at a time', 'batch' or both.
        tool: From task and setting, what its formula asks for besides the linkage.
        narrow: Whether it computes in single precision, crank angle and results included.
    """

    name: str
    stage: str
    needs: str
    source: str
    solve: Callable[..., Any] = stages.factored
    settings: tuple[Setting, ...] = ({},)
    steady: Setting = field(default_factory=dict)
    modes: tuple[str, ...] = (ONE, BATCH)
    tool: Callable[[Task, Setting], Any] | None = None
    narrow: bool = False


def label(setting: Setting) -> str:
    """A setting as text."""
    return ', '.join(f'{name} {value:g}' for name, value in setting.items())


@dataclass(frozen=True)
class Task:
    """A linkage and the motion of its crank.

    Attributes:
        mechanism: The linkage.
        guess: Coupler's direction and output at which an iteration begins.
        speed: Crank speed, rad/s; by default 150 rpm.
        acceleration: Crank acceleration, rad/s^2.
    """

    mechanism: Linkage
    guess: tuple[float, float]
    speed: float = 5 * math.pi
    acceleration: float = 20.0

    @classmethod
    def at(cls, mechanism: Linkage, crank: float) -> Task:
        """A task whose first guess is a position rounded to 0.1 rad or m."""
        position = Solver(mechanism).state(crank).position
        return cls(mechanism, (round(position[1], 1), round(position[2], 1)))

    def links(self, tool: Any = None) -> stages.Links:
        """Makes the constants of formulas, with the tool of a method."""
        mechanism, refuse = self.mechanism, Opaque(require_finite)
        rocker = mechanism.rocker.length if isinstance(mechanism, FourBar) else None
        if isinstance(mechanism, FourBar):
            base = mechanism.frame.length
        else:
            base = mechanism.slider.offset
        return stages.Links(
            mechanism.crank.length, mechanism.coupler.length, rocker, base,
            mechanism.frame.angle, 1.0 if mechanism.assembly == OPEN else -1.0,
            self.speed, self.acceleration,
            Model.of(mechanism, mechanism.structure().links, mechanism.loop(), *(refuse,) * 3),
            tool,
        )  # fmt: skip


def function_of(
    method: Method, task: Task, setting: Setting, quantity: str, mode: str
) -> Function:
    """Makes a quantity a function of the crank angle, including all preceding work.

    Args:
        method: A method for linkages.
        task: The task to solve.
        setting: Setting of the method.
        quantity: One of QUANTITIES.
        mode: Whether the function takes an angle or an array of them.

    Returns:
        The function: to the coupler's direction, an angle or the numbers of a unit vector, and
        the output, the same or m; to their velocities or accelerations; to the driving torque,
        N m, in a tuple of one.

    Raises:
        LinkageError: The method cannot solve this linkage.
    """
    tool = method.tool(task, setting) if method.tool else None
    formula = _formula(QUANTITIES.index(quantity), method.stage, method.solve)
    program = Program(formula, Constants(task.links(tool)), ('crank',))
    if method.narrow:
        return lambda crank: program.arrays(np.asarray(crank, np.float32))
    return program.scalar if mode == ONE else program.arrays


@functools.cache
def _formula(index: int, stage: str, solve: Callable[..., Any]) -> Callable[..., Any]:
    """Combines the stages, all but one the package's own; leaves out unused ones."""
    position = solve if stage == POSITION else stages.factored
    rates = stages.two_by_two if stage == POSITION else solve

    def solved(links: stages.Links, crank: Real) -> tuple[Real, ...]:
        speed, change = links.speed, links.change
        if stage == STATE:
            pose = links.model.loop.pose((crank,))
            place: Any = [link.position for link in pose.links[1:]]
        else:
            place, *slopes = rates(links, crank, functools.partial(position, links))
            pose = stages.posed(links, crank, place, *slopes)
        moving = [(link.jacobian[0], link.curvature[0]) for link in pose.links[1:]]
        velocities = tuple(k * speed for k, _ in moving)
        accelerations = tuple(c * (speed * speed) + k * change for k, c in moving)
        numbers = tuple(x for part in place for x in (part if type(part) is Vector else (part,)))
        drive = balance(links.model, pose, (speed, *velocities), (change, *accelerations))
        return (numbers, velocities, accelerations, tuple(drive))[index]

    return solved


def evaluate(function: Function, cranks: Array, mode: str) -> list[tuple[float, ...]]:
    """The values of a function at crank angles.

    Args:
        function: Function of the crank angle.
        cranks: Crank angles, rad.
        mode: 'one at a time' or 'batch'.

    Returns:
        A tuple for each angle.
    """
    if mode == ONE:
        return [function(crank) for crank in cranks.tolist()]
    columns = [np.broadcast_to(column, cranks.shape).tolist() for column in function(cranks)]
    return list(zip(*columns, strict=True))

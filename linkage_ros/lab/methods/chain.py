# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A method from the crank angle to position, velocity, acceleration and torque.

A method does one stage. The preceding stages are the package's own. A method for positions is
followed by the 2x2 solve of documents 1 and 4, so that its rates derive from its positions, and by
virtual power for the torque. So each method has a point in every chart from its stage on.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.dynamics.equations import Model
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.trees import Constants
from linkage_ros.formulas import Opaque
from linkage_ros.lab.methods import stages, torques
from linkage_ros.lab.methods.linkages import Linkage
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import OPEN
from linkage_ros.numeric import Array, Real, require_finite

QUANTITIES = ('position', 'rate', 'acceleration', 'torque')
STATE, POSITION, RATES, TORQUE, MOTION = 'state', 'position', 'rates', 'torque', 'motion'
ONE, BATCH = 'one at a time', 'batch'
# What a method of a stage itself computes.
OWN = {STATE: QUANTITIES, POSITION: QUANTITIES[:1], RATES: QUANTITIES[1:3], TORQUE: QUANTITIES[3:]}

Function: TypeAlias = Callable[[Real], tuple[Real, ...]]
Setting: TypeAlias = dict[str, float]


@dataclass(frozen=True)
class Method:
    """One way to solve a stage.

    Attributes:
        name: Name in charts and docs.
        stage: What it computes: 'state' (all of it), 'position', 'rates', 'torque' or 'motion'.
        needs: Inputs that it needs besides the lengths.
        source: Its source, with the equation.
        solve: The formula of its stage, as in `stages`; for a motion, a function of the initial
            value problem and a setting that begins to integrate it.
        settings: The settings for the accuracy chart, from coarse to fine.
        steady: The setting for the stability chart: the best practical one.
        modes: 'one at a time', 'batch' or both.
        sequential: Whether it proceeds from angle to angle, so that `steps` per turn are a
            setting.
        tool: Makes the formula's further inputs from task and setting.
        narrow: Whether it computes in single precision, including crank angle and results.
    """

    name: str
    stage: str
    needs: str
    source: str
    solve: Callable[..., Any] = stages.factored
    settings: tuple[Setting, ...] = ({},)
    steady: Setting = field(default_factory=dict)
    modes: tuple[str, ...] = (ONE, BATCH)
    sequential: bool = False
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

    def links(self, mode: str, tool: Any = None) -> stages.Links:
        """Makes the constants of formulas.

        Args:
            mode: 'one at a time' or 'batch'.
            tool: Tool of the method.

        Returns:
            The constants.
        """
        mechanism, structure = self.mechanism, self.mechanism.structure()
        refuse = Opaque(require_finite)
        rocker = mechanism.rocker.length if isinstance(mechanism, FourBar) else None
        if isinstance(mechanism, FourBar):
            base = mechanism.frame.length
        else:
            base = mechanism.slider.offset
        return stages.Links(
            mechanism.crank.length, mechanism.coupler.length, rocker, base,
            mechanism.frame.angle, 1.0 if mechanism.assembly == OPEN else -1.0,
            self.speed, self.acceleration, Model.of(mechanism, structure, *(refuse,) * 4),
            Opaque(math.acos if mode == ONE else np.arccos), tool,
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
        The function. It returns the coupler's direction, rad, and the output, rad or m; or their
        velocities or accelerations; or the driving torque, N m, in a tuple of one.

    Raises:
        LinkageError: The method cannot solve this linkage.
    """
    tool = method.tool(task, setting) if method.tool else None
    formula = _formula(QUANTITIES.index(quantity), method.stage, method.solve)
    program = Program(formula, Constants(task.links(mode, tool)), ('crank',))
    if method.narrow:
        return lambda crank: program.arrays(np.asarray(crank, np.float32))
    return program.compile() if mode == ONE else program.arrays


@functools.cache
def _formula(index: int, stage: str, solve: Callable[..., Any]) -> Callable[..., Any]:
    """Combines the stages, all but one the package's own; leaves out unused ones."""
    position = solve if stage == POSITION else stages.factored
    own_rates = stages.two_by_two if stage == POSITION else stages.analytic
    rates = solve if stage == RATES else own_rates
    own_torque = torques.own_balance if stage == STATE else torques.virtual_power
    torque = solve if stage == TORQUE else own_torque

    def solved(links: stages.Links, crank: Real) -> tuple[Real, ...]:
        speed, change = links.speed, links.change
        locate = functools.partial(position, links)
        place, first, second = rates(links, crank, locate)
        velocities = tuple(k * speed for k in first)
        accelerations = tuple(
            c * (speed * speed) + k * change for k, c in zip(first, second, strict=True)
        )
        drive = torque(
            links, (crank, *place), (1.0, *first), (speed, *velocities), (change, *accelerations)
        )
        return (place, velocities, accelerations, (drive,))[index]

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

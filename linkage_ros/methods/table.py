# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of methods: charts, tests and docs/methods.md read this one.

To add a method, write its function where its stage lives, and an entry here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from linkage_ros.core.numeric import SCALAR, Functions
from linkage_ros.methods import chain, interpolation, iteration, positions, rates, torques
from linkage_ros.methods.chain import BATCH, ONE, POSITION, RATES, STATE, TORQUE, Chain, Task
from linkage_ros.methods.loop import Loop

Setting = dict[str, float]


@dataclass(frozen=True)
class Method:
    """One way to solve a stage.

    Attributes:
        name: As charts and docs call it.
        stage: What it computes: 'state' (all of it), 'position', 'rates' or 'torque'.
        needs: What it asks for beside the lengths.
        source: Where it is described, to the equation.
        make: Builds it for a task, a setting and floats or arrays.
        settings: The settings for the accuracy chart, from coarse to fine.
        steady: The setting for the stability chart: the best that is of practical use.
        modes: 'one at a time', 'batch' or both.
        steps: Whether it goes from angle to angle, so that `steps` per turn are a setting.
    """

    name: str
    stage: str
    needs: str
    source: str
    make: Callable[[Task, Setting, Functions], Chain]
    settings: tuple[Setting, ...] = ({},)
    steady: Setting | None = None
    modes: tuple[str, ...] = (ONE, BATCH)
    steps: bool = False


def label(setting: Setting) -> str:
    """A setting in words."""
    return ', '.join(f'{name} {value:g}' for name, value in setting.items())


def _newton(task: Task, setting: Setting, *, warm: bool) -> Chain:
    locate = iteration.newton(Loop(task.mechanism), setting['tolerance'], task.guess, warm=warm)
    return chain.of_position(task, locate, SCALAR)


_TOLERANCES = (1e-1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15)
_STEPS = (10, 36, 100, 360, 1000, 3600)
_ITERATED = (
    *({'tolerance': tolerance, 'steps': 360} for tolerance in _TOLERANCES),
    *({'tolerance': 1e-3, 'steps': steps} for steps in _STEPS if steps != 360),
)

DEFAULT = 'factored closed form'

METHODS = (
    Method(
        DEFAULT, STATE, 'nothing', 'this package: core/transmission.py, docs/mechanisms.md',
        lambda task, _, f: chain.of_state(task, f),
    ),
    Method(
        'factored, float32', STATE, 'nothing', 'the same, in single precision',
        lambda task, _, f: chain.in_single_precision(task, f),
        modes=(BATCH,),
    ),
    Method(
        'half-angle', POSITION, 'nothing',
        'document 2, eq. 16 to 26; of a slider-crank by the same substitution',
        lambda task, _, f: chain.of_position(task, positions.half_angle(task.mechanism, f), f),
    ),
    Method(
        'inverse cosine', POSITION, 'nothing', 'law of cosines (Norton, Design of Machinery, 4.5)',
        lambda task, _, f: chain.of_position(
            task, positions.inverse_cosine(task.mechanism, f), f
        ),
    ),
    Method(
        'Newton-Raphson, warm', POSITION,
        'a first guess, and each angle close to the one before', 'document 1, eq. 8 to 12',
        lambda task, setting, _: _newton(task, setting, warm=True),
        _ITERATED, {'tolerance': 1e-12, 'steps': 360}, (ONE,), steps=True,
    ),
    Method(
        'Newton-Raphson, cold', POSITION, 'a first guess that serves every angle',
        'document 1, eq. 8 to 12',
        lambda task, setting, _: _newton(task, setting, warm=False),
        tuple({'tolerance': tolerance} for tolerance in _TOLERANCES), {'tolerance': 1e-12}, (ONE,),
    ),
    Method(
        'table, cubic Hermite', POSITION, 'a full turn; memory for its nodes',
        'de Boor, A Practical Guide to Splines, ch. IV',
        lambda task, setting, f: chain.of_position(
            task, interpolation.hermite(task.mechanism, int(setting['nodes']), f), f
        ),
        tuple({'nodes': 4**k} for k in range(2, 9)), {'nodes': 4096},
    ),
    Method(
        'Fourier series', POSITION, 'a full turn; a smooth motion',
        'Freudenstein, J. Appl. Mech. 26 (1959)',
        lambda task, setting, f: chain.of_position(
            task, interpolation.fourier(task.mechanism, int(setting['harmonics']), f), f
        ),
        tuple({'harmonics': n} for n in (2, 4, 8, 16, 32, 64)), {'harmonics': 64},
    ),
    Method(
        '2x2 solve', RATES, 'links not in line', 'documents 1 (eq. 13 to 18) and 4 (eq. 4 to 9)',
        lambda task, _, f: chain.of_rates(
            task, rates.two_by_two(task.mechanism, positions.factored(task.mechanism, f), f), f
        ),
    ),
    Method(
        'sine formula', RATES, 'links not in line',
        'document 2, eq. 27 to 33; accelerations by the same elimination',
        lambda task, _, f: chain.of_rates(
            task, rates.sine_formula(task.mechanism, positions.factored(task.mechanism, f), f), f
        ),
    ),
    Method(
        'central differences', RATES, 'positions a step to both sides',
        'Dahlquist and Bjorck, Numerical Methods in Scientific Computing, 3.3',
        lambda task, setting, f: chain.of_rates(
            task,
            rates.central_differences(
                task.mechanism, positions.factored(task.mechanism, f), setting['step'], f
            ),
            f,
        ),
        tuple({'step': 10.0**-k} for k in (1, 2, 3, 4, 5, 6, 7)), {'step': 1e-4},
    ),
    Method(
        'power balance', TORQUE, 'a crank that moves', 'document 1, eq. 1 to 6',
        lambda task, _, f: chain.of_torque(task, torques.power_balance(task.mechanism, f), f),
    ),
    Method(
        'constrained Newton-Euler', TORQUE, 'links not in line',
        'Norton, Design of Machinery, 11.4 and 11.5',
        lambda task, _, f: chain.of_torque(task, torques.newton_euler(task.mechanism, f), f),
    ),
)  # fmt: skip


def by_name(name: str) -> Method:
    """The entry of that name."""
    return next(method for method in METHODS if method.name == name)

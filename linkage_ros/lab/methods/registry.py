# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All methods: charts, tests and docs/methods.md read these.

To add a method, append an entry: here, or in a file of your own before a chart is drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeAlias, TypeVar

from linkage_ros.lab.methods import chain, interpolation, positions, rates, torques
from linkage_ros.lab.methods.chain import BATCH, ONE, POSITION, RATES, STATE, TORQUE, Chain, Task
from linkage_ros.lab.methods.functions import SCALAR, Functions
from linkage_ros.lab.methods.integrators import (
    Follower,
    Multipliers,
    OfPackage,
    OfScipy,
    RungeKutta4,
)
from linkage_ros.lab.methods.iteration import NewtonRaphson
from linkage_ros.lab.methods.loop import Loop
from linkage_ros.lab.reference.problems import InitialValueProblem
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.fixed_step_integrator import LONGEST_STEP, TOLERANCE, FixedSteps

Setting: TypeAlias = dict[str, float]
Make = TypeVar('Make')


@dataclass(frozen=True)
class Way(Generic[Make]):
    """One way to solve a stage.

    Attributes:
        name: As charts and docs call it.
        stage: What it computes: 'state' (all of it), 'position', 'rates', 'torque' or 'motion'.
        needs: What it asks for beside the lengths.
        source: Where it is described, to the equation.
        make: Builds it for a task, a setting and floats or arrays; an integrator for an initial
            value problem and a setting.
        settings: The settings for the accuracy chart, from coarse to fine.
        steady: The setting for the stability chart: the best that is of practical use.
        modes: 'one at a time', 'batch' or both.
        sequential: Whether it goes from angle to angle, so that `steps` per turn are a setting.
    """

    name: str
    stage: str
    needs: str
    source: str
    make: Make
    settings: tuple[Setting, ...] = ({},)
    steady: Setting = field(default_factory=dict)
    modes: tuple[str, ...] = (ONE, BATCH)
    sequential: bool = False


Method: TypeAlias = Way[Callable[[Task, Setting, Functions], Chain]]
Integrator: TypeAlias = Way[Callable[[InitialValueProblem, Setting], Follower]]


def label(setting: Setting) -> str:
    """A setting in words."""
    return ', '.join(f'{name} {value:g}' for name, value in setting.items())


def _newton(task: Task, setting: Setting, *, warm: bool) -> Chain:
    locate = NewtonRaphson(Loop(task.mechanism), setting['tolerance'], task.guess, warm=warm)
    return chain.of_position(task, locate, SCALAR)


def _exact(task: Task, f: Functions) -> positions.Locate:
    return positions.factored(task.mechanism, f)


_TOLERANCES = (1e-1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15)
_STEPS = (10, 36, 100, 360, 1000, 3600)
_ITERATED = (
    *({'tolerance': tolerance, 'steps': 360} for tolerance in _TOLERANCES),
    *({'tolerance': 1e-3, 'steps': steps} for steps in _STEPS if steps != 360),
)

DEFAULT = 'factored closed form'

METHODS = [
    Method(
        DEFAULT, STATE, 'nothing', 'this package: model/transmission.py, docs/mechanisms.md',
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
        _ITERATED, {'tolerance': 1e-12, 'steps': 360}, (ONE,), sequential=True,
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
        '2x2 solve', RATES, 'links not in line', 'documents 1 (eq. 13 to 18) and 4 (eq. 5 to 8)',
        lambda task, _, f: chain.of_stages(
            task, f, rates=rates.two_by_two(task.mechanism, _exact(task, f), f)
        ),
    ),
    Method(
        'sine formula', RATES, 'links not in line',
        'document 2, eq. 27 to 33; accelerations by the same elimination',
        lambda task, _, f: chain.of_stages(
            task, f, rates=rates.sine_formula(task.mechanism, _exact(task, f), f)
        ),
    ),
    Method(
        'central differences', RATES, 'positions a step to both sides',
        'Dahlquist and Bjorck, Numerical Methods in Scientific Computing, 3.3',
        lambda task, setting, f: chain.of_stages(
            task, f,
            rates=rates.central_differences(
                task.mechanism, _exact(task, f), setting['step'], f
            ),
        ),
        tuple({'step': 10.0**-k} for k in (1, 2, 3, 4, 5, 6, 7)), {'step': 1e-4},
    ),
    Method(
        'power balance', TORQUE, 'a crank that moves', 'document 1, eq. 1 to 6',
        lambda task, _, f: chain.of_stages(
            task, f, torque=torques.power_balance(task.mechanism, f)
        ),
    ),
    Method(
        'constrained Newton-Euler', TORQUE, 'links not in line',
        'Norton, Design of Machinery, 11.4 and 11.5',
        lambda task, _, f: chain.of_stages(
            task, f, torque=torques.newton_euler(task.mechanism, f)
        ),
    ),
]  # fmt: skip


MOTION = 'motion'
# The defaults, of live runs and of records.
LIVE, RECORDS = 'fixed steps, checked', 'DOP853, guarded'
_SECONDS = (0.025, 0.01, 0.005, 0.0025, LONGEST_STEP, 0.0005)
_LIVE: Setting = {'step': LONGEST_STEP, 'tolerance': TOLERANCE}
_UNCHECKED = 1e300  # no error of a step is larger
_DOP853 = 'Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.5 and II.6'


def _fixed(problem: InitialValueProblem, setting: Setting) -> Follower:
    step, tolerance = setting['step'], setting.get('tolerance', _UNCHECKED)
    return OfPackage(problem, lambda motion, start: FixedSteps(motion, start, step, tolerance))


# Steps are in s; the first two are the defaults.
INTEGRATORS = (
    Integrator(
        LIVE, MOTION, 'nothing',
        'Dormand and Prince, J. Comput. Appl. Math. 6 (1980), RK5(4)7M; '
        'motion/fixed_step_integrator.py',
        _fixed,
        # Without its tolerance no step is shortened, which shows the order.
        tuple(_LIVE if step == LONGEST_STEP else {'step': step} for step in _SECONDS), _LIVE,
    ),
    Integrator(
        RECORDS, MOTION, 'SciPy; a torque that does not leap',
        f'{_DOP853}; motion/adaptive_integrator.py',
        lambda problem, _: OfPackage(problem, AdaptiveSteps),
    ),
    Integrator(
        'DOP853', MOTION, 'SciPy; no edge of the coordinates on the way', _DOP853,
        lambda problem, setting: OfScipy(problem, 'DOP853', setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in (5, 7, 9, 11, 13)), {'tolerance': 1e-13},
    ),
    Integrator(
        'RK4', MOTION, 'a step that is short enough everywhere',
        'Hairer, Norsett and Wanner I, II.1, table 1.2',
        lambda problem, setting: RungeKutta4(problem, setting['step']),
        tuple({'step': step} for step in _SECONDS), {'step': LONGEST_STEP},
    ),
    Integrator(
        'Radau', MOTION, 'SciPy; no edge of the coordinates on the way',
        'Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8',
        lambda problem, setting: OfScipy(problem, 'Radau', setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in range(3, 9)), {'tolerance': 1e-7},
    ),
    Integrator(
        'multipliers, unstabilised', MOTION, 'SciPy; no change point; a short run',
        'Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), eq. 1 to 5; then DOP853',
        lambda problem, setting: Multipliers(problem, setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in (5, 7, 9, 11, 13)), {'tolerance': 1e-9},
    ),
)  # fmt: skip

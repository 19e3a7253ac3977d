# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All methods, for charts, tests and docs/methods.md.

To add a method, append an entry here, or in a file of your own before a chart is drawn.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial
from typing import Any

from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.trees import Constants
from linkage_ros.formulas import Opaque
from linkage_ros.lab.methods import stages, tables, torques
from linkage_ros.lab.methods.chain import (
    BATCH,
    MOTION,
    ONE,
    POSITION,
    RATES,
    STATE,
    TORQUE,
    Method,
    Setting,
    Task,
)
from linkage_ros.lab.methods.integrators import Multipliers, OfPackage, OfScipy, RungeKutta4
from linkage_ros.motion.fixed_step_integrator import LONGEST_STEP, TOLERANCE
from linkage_ros.motion.integrators import live_steps, record_steps


def _looks_up(make: Callable[[Task, Setting], Callable[..., Any]]) -> Callable[..., Any]:
    """The tool of `stages.looked_up`: a function for a position, and for both parts of it."""
    first, second = Opaque(operator.itemgetter(0)), Opaque(operator.itemgetter(1))
    return lambda task, setting: (Opaque(make(task, setting)), first, second)


def _newton(task: Task, setting: Setting, *, warm: bool) -> tables.NewtonRaphson:
    links = Constants(task.links(ONE))
    step = Program(stages.newton_step, links, ('crank', 'coupler', 'output')).compile()
    return tables.NewtonRaphson(step, task.guess, setting['tolerance'], warm=warm)


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
    ),
    Method(
        'factored, float32', STATE, 'nothing', 'the same, in single precision',
        modes=(BATCH,), narrow=True,
    ),
    Method(
        'half-angle', POSITION, 'nothing',
        'document 2, eq. 16 to 26; of a slider-crank by the same substitution',
        stages.half_angle,
    ),
    Method(
        'inverse cosine', POSITION, 'nothing', 'law of cosines (Norton, Design of Machinery, 4.5)',
        stages.inverse_cosine,
    ),
    Method(
        'Newton-Raphson, warm', POSITION,
        'a first guess, and each angle close to the one before', 'document 1, eq. 8 to 12',
        stages.looked_up, _ITERATED, {'tolerance': 1e-12, 'steps': 360}, (ONE,), sequential=True,
        tool=_looks_up(partial(_newton, warm=True)),
    ),
    Method(
        'Newton-Raphson, cold', POSITION, 'a first guess that serves every angle',
        'document 1, eq. 8 to 12', stages.looked_up,
        tuple({'tolerance': tolerance} for tolerance in _TOLERANCES), {'tolerance': 1e-12}, (ONE,),
        tool=_looks_up(partial(_newton, warm=False)),
    ),
    Method(
        'table, cubic Hermite', POSITION, 'a full turn; memory for its nodes',
        'de Boor, A Practical Guide to Splines, ch. IV', stages.looked_up,
        tuple({'nodes': 4**k} for k in range(2, 9)), {'nodes': 4096},
        tool=_looks_up(lambda task, setting: tables.hermite(task.mechanism, setting['nodes'])),
    ),
    Method(
        'Fourier series', POSITION, 'a full turn; a smooth motion',
        'Freudenstein, J. Appl. Mech. 26 (1959)', stages.looked_up,
        tuple({'harmonics': n} for n in (2, 4, 8, 16, 32, 64)), {'harmonics': 64},
        tool=_looks_up(lambda task, setting: tables.fourier(task.mechanism, setting['harmonics'])),
    ),
    Method(
        '2x2 solve', RATES, 'links not in line', 'documents 1 (eq. 13 to 18) and 4 (eq. 5 to 8)',
        stages.two_by_two,
    ),
    Method(
        'sine formula', RATES, 'links not in line',
        'document 2, eq. 27 to 33; accelerations by the same elimination', stages.sine_formula,
    ),
    Method(
        'central differences', RATES, 'positions a step to both sides',
        'Dahlquist and Bjorck, Numerical Methods in Scientific Computing, 3.3',
        stages.central_differences,
        tuple({'step': 10.0**-k} for k in (1, 2, 3, 4, 5, 6, 7)), {'step': 1e-4},
        tool=lambda _, setting: setting['step'],
    ),
    Method(
        'power balance', TORQUE, 'a crank that moves', 'document 1, eq. 1 to 6',
        torques.power_balance,
    ),
    Method(
        'constrained Newton-Euler', TORQUE, 'links not in line',
        'Norton, Design of Machinery, 11.4 and 11.5', torques.newton_euler,
        tool=lambda *_: Opaque(torques.last_unknown),
    ),
]  # fmt: skip


# The defaults, of live runs and of records.
LIVE, RECORDS = 'fixed steps, checked', 'DOP853, guarded'
_SECONDS = (0.025, 0.01, 0.005, 0.0025, LONGEST_STEP, 0.0005)
_LIVE: Setting = {'step': LONGEST_STEP, 'tolerance': TOLERANCE}
_UNCHECKED = 1e300  # no error of a step is larger
_DOP853 = 'Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.5 and II.6'

# Steps are in s; the first two are the defaults.
INTEGRATORS = (
    Method(
        LIVE, MOTION, 'nothing',
        'Dormand and Prince, J. Comput. Appl. Math. 6 (1980), RK5(4)7M; '
        'motion/fixed_step_integrator.py',
        lambda problem, setting: OfPackage(
            problem,
            partial(
                live_steps, longest=setting['step'],
                tolerance=setting.get('tolerance', _UNCHECKED),
            ),
        ),
        # Without its tolerance no step is shortened, which shows the order.
        tuple(_LIVE if step == LONGEST_STEP else {'step': step} for step in _SECONDS), _LIVE,
    ),
    Method(
        RECORDS, MOTION, 'SciPy; a torque that does not leap',
        f'{_DOP853}; motion/adaptive_integrator.py',
        lambda problem, _: OfPackage(problem, record_steps),
    ),
    Method(
        'DOP853', MOTION, 'SciPy; no edge of the coordinates on the way', _DOP853,
        lambda problem, setting: OfScipy(problem, 'DOP853', setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in (5, 7, 9, 11, 13)), {'tolerance': 1e-13},
    ),
    Method(
        'RK4', MOTION, 'a step that is short enough everywhere',
        'Hairer, Norsett and Wanner I, II.1, table 1.2',
        lambda problem, setting: RungeKutta4(problem, setting['step']),
        tuple({'step': step} for step in _SECONDS), {'step': LONGEST_STEP},
    ),
    Method(
        'Radau', MOTION, 'SciPy; no edge of the coordinates on the way',
        'Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8',
        lambda problem, setting: OfScipy(problem, 'Radau', setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in range(3, 9)), {'tolerance': 1e-7},
    ),
    Method(
        'multipliers, unstabilised', MOTION, 'SciPy; no change point; a short run',
        'Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), eq. 1 to 5; then DOP853',
        lambda problem, setting: Multipliers(problem, setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in (5, 7, 9, 11, 13)), {'tolerance': 1e-9},
    ),
)  # fmt: skip

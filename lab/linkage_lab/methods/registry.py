# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All methods, for charts, tests and lab/docs/methods.md.

To add a method, append a `Method` to `METHODS`, here or in your own module that is imported
before a chart is drawn. Position methods that iterate or use a table have a tool, which makes a
function of the crank angle.
"""

import cmath
import math
from functools import lru_cache, partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from linkage_lab.methods import stages
from linkage_lab.methods.integrators import Multipliers, OfPackage, OfScipy, RungeKutta4
from linkage_lab.methods.linkage_cases import LinkageCase
from linkage_lab.methods.measure import BATCH, ONE, Method, Setting
from linkage_lab.methods.stages import POSITION, QUANTITIES, RATES, STATE, Locate, Pair
from linkage_lab.reference.states import Linkage, lengths
from linkage_ros import ConfigurationError, Solver
from linkage_ros.extensions import Constants, Program
from linkage_ros.formulas import Real
from linkage_ros.internals import live_steps, record_steps

CAP = 50
_ENDLESS = 200  # iteration limit of a method that has none of its own


def newton_raphson(case: LinkageCase, setting: Setting) -> Locate:
    """Newton-Raphson on the loop equation, as in Ghalbi 2019 (eq. 8 to 12).

    Each angle starts from the solution of the previous one. The document does not limit the
    iterations; here the limit is 50, and the last iterate is returned.

    Args:
        case: The linkage and the initial guess.
        setting: 'tolerance' of the step (rad; m for a slider) and of the residual (m).

    Returns:
        Function from the crank angle, rad, to coupler and output.
    """
    constants = Constants(stages.Links.of(case.mechanism))
    step = Program(stages.newton_step, constants, ('crank', 'coupler', 'output')).floats
    position, tolerance = case.guess, setting['tolerance']

    def locate(crank: float) -> Pair:
        nonlocal position  # also after an error, the next angle starts from the last iterate
        for _ in range(CAP):
            coupler_step, output_step, gap_x, gap_y = step(crank, *position)
            position = position[0] + coupler_step, position[1] + output_step
            if max(map(abs, (coupler_step, output_step, gap_x, gap_y))) <= tolerance:
                break
        return position

    return locate


def listing(case: LinkageCase, _: Setting) -> Locate:
    """Ghalbi's listing as printed, for a four-bar: see lab/docs/errata.md.

    The second column of the listing's Jacobian has the coupler's length instead of the rocker's,
    and a complex number instead of its real part. The angles therefore become complex; the listing
    plots their real parts.
    """
    mechanism, angles = case.mechanism, np.array(case.guess)  # of coupler and rocker

    def locate(crank: float) -> Pair:
        nonlocal angles
        r, b, c, d = lengths(mechanism)
        if c is None:
            raise ConfigurationError("Ghalbi's listing is for a four-bar")
        fixed = cmath.rect(r, crank) - cmath.rect(d, mechanism.frame.angle)
        for _ in range(_ENDLESS):
            coupler, rocker = np.exp(1j * angles)
            gap = fixed + b * coupler - c * rocker
            by_coupler, by_rocker = (
                1j * b * coupler,
                -1j * b * rocker,
            )  # both errors of the listing
            jacobian = np.array([[by_coupler.real, by_rocker], [by_coupler.imag, by_rocker.imag]])
            residual = np.array([gap.real, gap.imag])
            step = np.dot(-np.linalg.inv(jacobian), residual)
            angles = angles + step
            if not np.any(np.abs([*step, *residual]) > 1e-3):
                return float(angles[0].real), float(angles[1].real)
        raise ArithmeticError('the iteration does not end')

    return locate


# Cached, because a chart requests each table several times in a row.
@lru_cache(maxsize=2)
def hermite(mechanism: Linkage, nodes: int) -> Locate:
    """Interpolates in a table of exact positions and rates over one period.

    The interpolation is cubic Hermite (de Boor, A Practical Guide to Splines, ch. IV).

    Args:
        mechanism: Linkage whose crank turns fully.
        nodes: Number of nodes per period.

    Returns:
        Function from the crank angle, rad, to the positions of all other links.
    """
    solver = Solver(mechanism)
    solver.reach.require_full_turn()
    length = solver.reach.period_turns * math.tau
    state = solver.state(np.arange(nodes + 1) * (length / nodes), 1.0)
    links = zip(solver.structure.links[1:], state.position[1:], strict=True)
    positions = [row if link.slides else np.unwrap(row) for link, row in links]
    slopes = np.transpose(state.velocity[1:]) * (length / nodes)
    spline = CubicHermiteSpline(np.arange(nodes + 1), np.transpose(positions), slopes)
    # Coefficients in increasing order, of all links in one array: fancy indices are then fastest.
    table = np.concatenate(spline.c[::-1].transpose(0, 2, 1))  # shape (4 x links, nodes)
    count, nodes_per_angle = len(positions), nodes / length
    by_node = table.reshape(4, count, nodes).T.tolist()  # for each node and link, four floats

    def look_up(crank: Real) -> Pair:
        place = (crank % length) * nodes_per_angle
        if isinstance(place, float):
            node: Any = min(int(place), nodes - 1)
            coefficients = by_node[node]
        else:
            node = np.minimum(place.astype(np.intp), nodes - 1)
            coefficients = table[:, node].reshape(4, count, -1).swapaxes(0, 1)
        t = place - node
        if count == 2:  # a loop without dyads; written out, this is a third faster
            (a1, b1, c1, d1), (a2, b2, c2, d2) = coefficients
            return a1 + t * (b1 + t * (c1 + t * d1)), a2 + t * (b2 + t * (c2 + t * d2))
        return [a + t * (b + t * (c + t * d)) for a, b, c, d in coefficients]

    return look_up


DEFAULT = 'factored closed form'

METHODS = [
    Method(
        DEFAULT, STATE, 'nothing', 'this package: mechanism/transmission.py, docs/mechanisms.md',
        stages.factored, dyads=QUANTITIES,
    ),
    Method(
        'factored, float32', STATE, 'nothing', 'the same, in single precision',
        stages.factored, modes=(BATCH,), narrow=True, dyads=QUANTITIES,
    ),
    Method(
        'two circles', POSITION, 'nothing',
        'P. Bourke, Intersection of two circles, 1997; unit vectors in place of angles',
        stages.two_circles,
    ),
    Method(
        'half-angle', POSITION, 'nothing',
        'Mottola 2017, eq. 16 to 26; the same substitution for a slider-crank',
        stages.half_angle,
    ),
    Method(
        'Newton-Raphson', POSITION,
        'a first guess; small steps of the crank angle', 'Ghalbi 2019, eq. 8 to 12',
        stages.looked_up, tuple({'tolerance': 10.0**-k} for k in (1, 3, 6, 9, 12, 15)),
        {'tolerance': 1e-12}, (ONE,), tool=newton_raphson,
    ),
    Method(
        "Ghalbi's listing", POSITION, 'the same; a four-bar',
        'Ghalbi 2019, as printed; see the errata', stages.looked_up, modes=(ONE,),
        tool=listing,
    ),
    Method(
        'table, cubic Hermite', POSITION, 'a crank that turns fully; memory',
        'de Boor, A Practical Guide to Splines, ch. IV', stages.looked_up,
        tuple({'nodes': 4**k} for k in range(2, 9)), {'nodes': 4096},
        tool=lambda case, setting: hermite(case.mechanism, setting['nodes']),
        dyads=QUANTITIES[:1],
    ),
    Method(
        '2x2 solve', RATES, 'links not in line', 'documents 1 (eq. 13 to 18) and 4 (eq. 5 to 8)',
        stages.two_by_two,
    ),
    Method(
        'central differences', RATES, 'positions one step before and after',
        'Dahlquist and Bjorck, Numerical Methods in Scientific Computing, 3.3',
        stages.central_differences,
        tuple({'step': 10.0**-k} for k in (1, 2, 3, 4, 5, 6, 7)), {'step': 1e-4},
        tool=lambda _, setting: setting['step'], dyads=QUANTITIES[1:],
    ),
]  # fmt: skip


# Default integrators of live runs and of records.
LIVE, RECORDS = 'fixed steps, checked', 'DOP853, guarded'
# The longest step, s, and the tolerance of a live run.
_LIVE: Setting = {'step': 1e-3, 'tolerance': 1e-9}
_SECONDS = (0.025, 0.01, 0.005, 0.0025, _LIVE['step'], 0.0005)
_DOP853 = 'Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.5 and II.6'

_MULTIPLIERS = tuple({'tolerance': 10.0**-k} for k in (5, 7, 9, 11, 13)), {'tolerance': 1e-9}

# Steps are in s; the first two integrators are the defaults.
INTEGRATORS = (
    Method(
        LIVE, 'motion', 'nothing',
        'Dormand and Prince, J. Comput. Appl. Math. 6 (1980), RK5(4)7M; '
        'motion/runge_kutta.py',
        lambda problem, setting: OfPackage(
            problem,
            partial(
                live_steps, longest=setting['step'],
                tolerance=setting.get('tolerance', math.inf),
            ),
        ),
        # Without a tolerance, no step is shortened, so that the chart shows the order.
        tuple(_LIVE if step == _LIVE['step'] else {'step': step} for step in _SECONDS), _LIVE,
    ),
    Method(
        RECORDS, 'motion', 'SciPy; a torque without jumps',
        f'{_DOP853}; motion/steps.py',
        lambda problem, _: OfPackage(problem, record_steps),
    ),
    Method(
        'DOP853', 'motion', 'SciPy; no singularity of the coordinates', _DOP853,
        lambda problem, setting: OfScipy(problem, 'DOP853', setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in (5, 7, 9, 11, 13)), {'tolerance': 1e-13},
    ),
    Method(
        'RK4', 'motion', 'a step that is short enough everywhere',
        'Hairer, Norsett and Wanner I, II.1, table 1.2',
        lambda problem, setting: RungeKutta4(problem, setting['step']),
        tuple({'step': step} for step in _SECONDS), {'step': _LIVE['step']},
    ),
    Method(
        'Radau', 'motion', 'SciPy; no singularity of the coordinates',
        'Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8',
        lambda problem, setting: OfScipy(problem, 'Radau', setting['tolerance']),
        tuple({'tolerance': 10.0**-k} for k in range(3, 9)), {'tolerance': 1e-7},
    ),
    Method(
        'multipliers, unstabilised', 'motion', 'SciPy; no change point; a short run',
        'Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), eq. 1 to 5; then DOP853',
        lambda problem, setting: Multipliers(problem, setting['tolerance']), *_MULTIPLIERS,
    ),
    Method(
        'multipliers, Baumgarte', 'motion',
        'SciPy; no change point; a rate at which the gap decays',
        "the same; the gap obeys gap'' + 2 k gap' + k^2 gap = 0, k = 20/s",
        lambda problem, setting: Multipliers(problem, setting['tolerance'], closing=20.0),
        *_MULTIPLIERS,
    ),
    Method(
        'multipliers, projected', 'motion', 'SciPy; no strong damping',
        'Eich, SIAM J. Numer. Anal. 30 (1993); projects positions and rates after every step',
        lambda problem, setting: Multipliers(problem, setting['tolerance'], projects=True),
        *_MULTIPLIERS,
    ),
)  # fmt: skip

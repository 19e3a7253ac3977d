# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The assemblies of a linkage at a crank angle: none, one or two."""

import cmath
import math
from dataclasses import replace

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import ConfigurationError, UnreachableError
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import CROSSED, OPEN
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.numeric import real_numbers, require_finite, wrap
from linkage_ros.quantities import shown

_SAME = 16 * 2.0**-53  # relative: a few rounding errors of an angle of one turn


def assemblies(mechanism: FourBar | SliderCrank, crank: float) -> tuple[tuple[float, ...], ...]:
    """Finds the assemblies of a linkage at a crank angle.

    Document 2 counts them: two, the open assembly and then the crossed one; one, where coupler
    and output are in line (for a slider-crank: the coupler and the normal of the guide), at the
    end of a limited crank's reach or at a change point; none beyond that reach.

    Args:
        mechanism: The linkage; its own `assembly` is ignored.
        crank: Crank angle, rad.

    Returns:
        For each assembly the positions of crank, coupler and output, as in `State.position`.

    Raises:
        ConfigurationError: The crank angle is not one finite number.
    """
    if np.shape(crank):
        raise ConfigurationError(f'crank angle = {shown(crank)}: give one number')
    (crank,), _ = real_numbers(crank_angle=crank)
    require_finite(crank_angle=crank)
    solvers = [Solver(replace(mechanism, assembly=name)) for name in (OPEN, CROSSED)]
    reach, near = solvers[0].reach, _SAME * max(abs(crank), math.tau)
    ends = () if reach.turns_fully else [end for arc in reach.arcs for end in arc]
    if any(abs(math.remainder(crank - end, math.tau)) <= near for end in ends):
        return (_in_line(mechanism, crank),)
    try:
        both = [solver.state(crank).position for solver in solvers]
    except UnreachableError:
        return ()
    slides = isinstance(mechanism, SliderCrank)
    _, *turned = [x - y for x, y in zip(*both, strict=True)]
    slid = turned.pop() / mechanism.coupler.length if slides else 0.0
    apart = max(abs(slid), *(abs(wrap(angle)) for angle in turned))
    return tuple(both[:1] if apart <= near else both)


def _in_line(mechanism: FourBar | SliderCrank, crank: float) -> tuple[float, ...]:
    """The position at the end of a crank's reach: both assemblies meet there."""
    angle, pin = mechanism.frame.angle, cmath.rect(mechanism.crank.length, crank)
    b = mechanism.coupler.length
    if isinstance(mechanism, SliderCrank):
        along = pin * cmath.rect(1.0, -angle)
        side = math.copysign(math.pi / 2, mechanism.slider.offset - along.imag)
        return crank, wrap(angle + side), along.real
    c, to_pivot = mechanism.rocker.length, cmath.rect(mechanism.frame.length, angle) - pin
    stretched = abs(abs(to_pivot) - (b + c)) < abs(abs(to_pivot) - abs(b - c))
    coupler = cmath.phase(to_pivot if stretched or b > c else -to_pivot)
    return crank, coupler, wrap(coupler + math.pi) if stretched else coupler

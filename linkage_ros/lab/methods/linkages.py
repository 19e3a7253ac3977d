# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Linkages for testing methods, some of them random."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.parts import CROSSED, OPEN, Body, Coupler, Frame, Guide, Rocker, Slider
from linkage_ros.model.slider_crank import SliderCrank

# The mechanisms whose loop textbooks solve in closed form.
Linkage: TypeAlias = FourBar | SliderCrank
Random: TypeAlias = np.random.Generator


def four_bar(lengths: tuple[float, ...], assembly: str = OPEN, angle: float = 0.0) -> FourBar:
    """A four-bar of uniform rods.

    Args:
        lengths: Lengths of crank, coupler, rocker and frame, m.
        assembly: 'open' or 'crossed'.
        angle: Angle of the frame, rad.

    Returns:
        The linkage.
    """
    r, b, c, d = lengths
    return FourBar(Frame(d, angle), Body(*_rod(r)), Coupler(*_rod(b)), Rocker(*_rod(c)), assembly)


def slider_crank(
    r: float, b: float, offset: float, assembly: str = OPEN, angle: float = 0.0
) -> SliderCrank:
    """A slider-crank of uniform rods and a slider of 1 kg.

    Args:
        r: Length of the crank, m.
        b: Length of the coupler, m.
        offset: Offset of the slider, m.
        assembly: 'open' or 'crossed'.
        angle: Angle of the guide, rad.

    Returns:
        The linkage.
    """
    slider = Slider(offset, 1.0)
    return SliderCrank(Body(*_rod(r)), Coupler(*_rod(b)), slider, Guide(angle), assembly)


def _rod(length: float) -> tuple[float, float, float, tuple[float, float]]:
    """Length, mass, inertia and centre of a uniform rod of 2 kg."""
    return length, 2.0, length * length / 6, (length / 2, 0.0)


def other_assembly(mechanism: Linkage) -> Linkage:
    """The same links in the other assembly."""
    return replace(mechanism, assembly=CROSSED if mechanism.assembly == OPEN else OPEN)


def any_assembly(random: Random) -> str:
    """One of the two assemblies, at random."""
    return OPEN if random.random() < 0.5 else CROSSED


def turning(random: Random) -> Linkage:
    """A random linkage that turns fully, far from change points."""
    while True:
        angle = float(random.uniform(-math.pi, math.pi))
        if random.random() < 0.3:
            r, b = float(random.uniform(0.1, 0.3)), float(random.uniform(0.5, 1.0))
            offset = float(random.uniform(-0.3, 0.3)) * (b - r)
            return slider_crank(r, b, offset, any_assembly(random), angle)
        lengths = tuple(float(x) for x in random.uniform(0.1, 1.0, 4))
        r, b, c, d = lengths
        sums = (b + c - d - r, (d - r - b + c), (d - r + b - c))
        if sums[0] > 0.05 and sums[1] * sums[2] > 0.0025 and r > 0.05:
            return four_bar(lengths, any_assembly(random), angle)


def with_change_point(random: Random) -> FourBar:
    """Random lengths in 64ths of a metre, with a change point at exactly crank angle 0."""
    r = int(random.integers(8, 24))
    d, b = r + int(random.integers(4, 24)), r + int(random.integers(4, 24))
    lengths = tuple(x / 64 for x in (r, b, d - r + b, d))
    return four_bar(lengths, any_assembly(random))


def limited(random: Random) -> FourBar:
    """A four-bar whose crank cannot turn fully."""
    while True:
        lengths = tuple(float(x) for x in random.uniform(0.2, 1.0, 4))
        r, b, c, d = lengths
        near = (d - r - b + c) * (d - r + b - c)
        reach = b + c - abs(d - r) > 0.05 and abs(b - c) - (d + r) < -0.05
        if reach and (b + c - d - r < -0.05) != (near < -0.01):
            return four_bar(lengths, any_assembly(random), float(random.uniform(-3, 3)))

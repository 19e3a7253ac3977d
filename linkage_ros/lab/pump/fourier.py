# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Periodic functions as Fourier series: exact between the samples, if these are enough."""

from __future__ import annotations

import math

import numpy as np

from linkage_ros.numeric import Array

_ITERATIONS = 6


def extremum(samples: Array, sign: int) -> float:
    """The largest or least value of a function of period 2 pi, from its Fourier series.

    Args:
        samples: Its values in equal parts of the period, enough for the series to end.
        sign: 1: the largest; -1: the least.

    Returns:
        The value.
    """
    count = len(samples)
    terms = np.fft.rfft(samples)[: count // 2] / count
    terms[1:] *= 2
    orders = np.arange(len(terms))
    angle = 2 * math.pi / count * int(np.argmax(sign * samples))
    for _ in range(_ITERATIONS):
        waves = terms * np.exp(1j * orders * angle)
        first, second = -np.sum(orders * waves.imag), -np.sum(orders**2 * waves.real)
        if not sign * second < 0:  # flat: a slider that rests
            break
        angle -= first / second
    return float(np.sum((terms * np.exp(1j * orders * angle)).real))

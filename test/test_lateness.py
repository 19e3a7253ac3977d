# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Quantiles from bins stay near those of the numbers themselves."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from linkage_ros.run.lateness import Lateness


@given(st.lists(st.integers(0, 2**62 - 1), min_size=1), st.floats(0.0, 1.0))
def test_a_quantile_is_never_too_short_and_at_most_3_percent_too_long(times, part):
    late = Lateness()
    for one in times:
        late.add(one)
    exact = sorted(times)[max(0, math.ceil(part * len(times)) - 1)]
    assert exact <= late.quantile(part) <= exact * (1 + 1 / 32)
    assert late.greatest == max(times)


@pytest.mark.parametrize('number', [0, 1, 31, 32, 33, 63, 64, 65, 2**40, 2**62 - 1])
def test_one_number_is_its_own_quantile(number):
    late = Lateness()
    late.add(number)
    assert late.quantile(0.5) == late.quantile(1.0) == number


def test_nothing_counted_is_no_lateness():
    assert Lateness().quantile(0.99) == 0

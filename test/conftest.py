# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What all tests share: floating-point surprises are errors, random cases repeat, signals work."""

from __future__ import annotations

import signal

import numpy as np
from hypothesis import settings

# What starts the checks in the background may have them ignore these, and so what they start.
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGQUIT, signal.SIG_DFL),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, handler)

np.seterr(all='raise')
settings.register_profile(
    'repeatable', deadline=None, derandomize=True, database=None, max_examples=60
)
settings.load_profile('repeatable')

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What keeps tests apart that run at the same time."""

from __future__ import annotations

from ros_harness import Listener, fresh_domain


def test_a_domain_in_which_somebody_listens_is_nobody_elses():
    domain = fresh_domain()
    with Listener(domain, {}):
        others = [fresh_domain() for _ in range(50)]
    assert domain not in others
    assert domain in [fresh_domain() for _ in range(50)]  # free again

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Describes a linkage in one line."""

from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.travel import travel
from linkage_ros.settings.configuration import Linkage


def summary(linkage: Linkage, solver: Solver) -> str:
    """Describes the mechanism of a linkage, which the solver has, and its motion in one line."""
    words = [linkage.mechanism_words, linkage.mechanism.assembly]
    if reach := solver.mobility:
        words.append(f'driven {reach.driven}' if reach.slides else reach.grashof)
        if reach.turns_fully:
            words += travel(solver).words()
    drive = linkage.drive
    rate = f' at {linkage.session.rate_hz:g} Hz'
    moved = drive.words(solver.structure.driven_link)
    words.append(moved + ('' if drive.is_measured else rate))
    return ', '.join(words)

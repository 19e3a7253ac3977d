# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The settled states of an analysis as a table, for people."""

from __future__ import annotations

import math

from linkage_ros.lab.pump.pump import Analysis
from linkage_ros.lab.pump.sensitivity import CHANGES


def states_table(analysis: Analysis) -> list[str]:
    """The states, and the stable ones under changed torques.

    Args:
        analysis: Analysis of a pump.

    Returns:
        Lines, for a font of equal widths.
    """
    if not analysis.states:
        return ['no settled motion found']
    lines = [
        f'{"":<11}{"mean speed":>13}{"averaged":>11}{"stroke":>11}{"flow":>11}'
        f'{"largest":>20}' + ''.join(f'{f"torque {change - 1:+.0%}":>27}' for change in CHANGES),
        f'{"":<11}{"rad/s":>13}{"rad/s":>11}{"m":>11}{"m/s":>11}'
        f'{"multiplier":>20}' + f'{"speed":>11}{"stroke":>8}{"flow":>8}' * len(CHANGES),
    ]
    for number, state in enumerate(analysis.states):
        guesses = [one.speed for one in analysis.averaged_states]
        guess = min(guesses, key=lambda speed: abs(speed - state.speed), default=math.nan)
        changes = [one.changes for one in analysis.sensitivities if one.state == number]
        lines.append(
            f'{"stable" if state.stable else "unstable":<11}{state.speed:>13.6f}{guess:>11.4f}'
            f'{state.stroke:>11.6f}{state.flow:>11.6f}{_complex(state.multipliers[0]):>20}'
            + ''.join('   ' + _words(one) for one in changes)
        )
    return lines


def _words(changes: dict[str, float]) -> str:
    return ''.join(f'{change:>+8.2%}' for change in changes.values()) or f'{"no such state":>24}'


def _complex(value: complex) -> str:
    return f'{value.real:.4f}' + (f' \N{PLUS-MINUS SIGN} {value.imag:.4f}i' if value.imag else '')

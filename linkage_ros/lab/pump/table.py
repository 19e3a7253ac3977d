# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Describes the steady states of a wind pump as lines of text."""

from __future__ import annotations

from collections.abc import Iterator
from operator import itemgetter

from linkage_ros.lab.pump.alternating import alternating_lines
from linkage_ros.lab.pump.analysis import CHANGED, COUNT, Analysis
from linkage_ros.lab.pump.equations import BOTH
from linkage_ros.lab.pump.harmonic_balance import STATE

_FEW = 0.01  # share of the starts that is not worth a line
_LARGE = 1e4  # multiplier of which only the magnitude is shown
_NOTE = (
    'multiplier: growth of a small deviation over a period; Floquet: of the exact motion; '
    'slow flow: of the averaged motion, an estimate'
)


def states_table(analysis: Analysis) -> list[str]:
    """Formats tables of states, of their sensitivity to the torque, and of unexplained starts.

    Args:
        analysis: Analysis of a pump.

    Returns:
        Lines for a monospaced font.
    """
    ends = {
        '{} come to rest, or rock to and fro': analysis.stopped,
        'warning: {} settle at no state that is listed: their motion is quasi-periodic, chaotic, '
        'of a long period, or had not settled when its time ran out (slow where motor.damping or '
        'slider.damping is small); draw such motions with --speeds': analysis.unidentified,
    }  # fmt: skip
    lines = [*_states_lines(analysis), *_changes_lines(analysis)]
    lines += [*_remarks(analysis), *alternating_lines(analysis.alternating, COUNT)]
    lines += [
        words.format(f'{share:.1%} of {COUNT} starts')
        for words, share in ends.items()
        if share > _FEW
    ]
    if analysis.has_corners:
        lines.append(
            'the load curve has corners: speeds are right to about 0.01 %, multipliers to 1 %'
        )
    if analysis.spread:
        lines.append(
            'the jump of load.return_value is spread over slider speeds of '
            f'+-{analysis.spread:.2g} m/s: speeds are right to about 0.5 %, multipliers to 0.02'
        )
    return lines


def _states_lines(analysis: Analysis) -> list[str]:
    if not analysis.states:
        return ['no settled motion found']
    head = (
        ('', 'turns', 'mean speed', 'stroke', 'flow', 'efficiency', 'starts', 'Floquet',
         'averaged', 'slow flow'),
        ('', '', 'rad/s', 'm', 'm/s', '', '', 'multiplier', 'rad/s', 'multiplier'),
    )  # fmt: skip
    rows = [_cells(analysis, number) for number in range(len(analysis.states))]
    widths = '{:<9}{:>6}{:>12}{:>10}{:>10}{:>12}{:>9}{:>20}{:>10}{:>20}'
    return [*(widths.format(*row) for row in (*head, *rows)), _NOTE]


def _remarks(analysis: Analysis) -> Iterator[str]:
    """Lines about states in another assembly, and about states with fewer correct digits."""
    for state in analysis.states:
        if state.motion.tail > STATE.tail:
            error = 10 * state.motion.tail
            yield f'{state.name}: numbers are right to about {error:.0e} of their size'
        assembly = state.motion.assembly
        if assembly == BOTH:
            yield f'{state.name}: stretches the dyad, and so alternates between the assemblies'
        elif assembly != analysis.assembly:
            yield f'{state.name}: in the {assembly} assembly'


def _cells(analysis: Analysis, number: int) -> tuple[str, ...]:
    """Returns the table cells of a state and of the averaged state near it."""
    state, averaged = analysis.states[number].motion, analysis.averaged[number]
    share = state.efficiency
    return (
        'stable' if state.stable else 'unstable', str(state.turns), f'{state.speed:.6f}',
        f'{state.stroke:.6f}', f'{state.flow:.6f}', '-' if share is None else _fixed(share),
        f'{analysis.shares[number]:.1%}' if state.stable else '-', _complex(state.multipliers[0]),
        f'{averaged.speed:.4f}' if averaged else '-',
        _complex(averaged.multipliers[0]) if averaged else '-',
    )  # fmt: skip


def _complex(value: complex) -> str:
    if abs(value) >= _LARGE:
        return f'{abs(value):.1e}'
    aside = f' \N{PLUS-MINUS SIGN} {_fixed(value.imag)}i' if value.imag else ''
    return f'{_fixed(value.real)}{aside}'


def _fixed(value: float, form: str = '.4f') -> str:
    """Formats a value rounded to four decimals; -0 becomes 0."""
    return format(round(value, 4) + 0.0, form)


def _changes_lines(analysis: Analysis) -> list[str]:
    """Makes a table of the relative changes of each stable state if the motor torque changes."""
    head = 'changes of the stable states with the torque', *CHANGED
    lines = ['{:<46}{:>10}{:>10}{:>10}'.format(*head)]
    for one in sorted(analysis.sensitivities, key=itemgetter('state')):
        change = one['torque'] / analysis.motor.torque - 1
        name = f'{analysis.states[one["state"]].name}, torque {change:+.0%}'
        cells = ''.join(f'{_fixed(change, "+.2%"):>10}' for change in one['changes'].values())
        lines.append(f'{name:<46}{cells}' if cells else f'{name}: {one["reason"]}')
    return lines if analysis.sensitivities else []

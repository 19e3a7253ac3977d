# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes lab/docs/peers.md from the results of a run."""

WORKS = {'kinematics': 'kinematics', 'torque': 'with torque'}
MODES = {'one': 'One state at a time', 'array': 'Arrays'}
ERRORS = {
    'max_error_position': 'angle, rad',
    'max_error_rate': 'rate, rad/s',
    'max_error_acceleration': 'acceleration, rad/s²',
    'max_error_torque': 'torque, N m',
}
INTRODUCTION = """\
# Comparison with other software

This page compares other software (peers) with this package on the same task. This command measured
the figures in one run and wrote the page on {date}, with {machine[cpu]}, {machine[cores]} cores,
{machine[os]}, Python {python}, NumPy {libraries[numpy]}{compiler}:

    python benchmarks/peers/run.py --markdown lab/docs/peers.md

The task is to compute the angle, rate and acceleration of coupler and rocker of the four-bar of
Ghalbi 2019 (`config/quadrilateral.yaml`) at 150 rpm and, in the rows "with torque", the driving
torque. A ratio is a peer's time divided by the time of this package; above 1, this package is
faster. For arrays, a peer without torque is compared with the package's program that includes
it. The ratio is the median of {rounds} rounds, in which peer and package run alternately. Set-up
and compilation are not timed. Errors are the largest over {turn} crank angles, compared with a
solution in 50 digits.
"""
HARD = """\
## Situations

Each peer solves one state at a time, and each state has one of these outcomes:

- *right*: the angles are within 1e-6 rad of a solution in 50 digits, and the rates and
  accelerations are within 1e-6 (relative for values above 1);
- *rates wrong*: only the angles are right;
- *wrong branch*: the angles are those of the other assembly;
- *NaN*: the result is not a number, or the peer raises an arithmetic error;
- *refused*: the peer raises another error;
- *diverged*: the angles belong to neither assembly, or the peer returns a number although the loop
  cannot close.

Each cell shows the worst outcome and, unless all states have it, the share of states that do. NaN
is the worst, followed by wrong branch and diverged. Peers are given the correct first state, if
they use it.
"""


def table(head, rows):
    """Yields the lines of a table; the first column is text, the others are numbers."""
    yield f'| {" | ".join(head)} |'
    yield f'|---{"|--:" * (len(head) - 1)}|'
    for row in rows:
        yield f'| {" | ".join(row)} |'


def number(value, form):
    """Formats a number; None gives a dash."""
    return '-' if value is None else format(value, form)


def speeds(records, mode):
    """Returns the lines of the table for single states or for arrays."""
    unit, factor = ('us', 1) if mode == 'one' else ('ns', 1000)
    head = ['', 'work', f'{unit} per state', 'ratio', *ERRORS.values()]
    rows = []
    for record in records:
        if record['mode'] == mode:
            time = number(record['us_per_state'] * factor, '.3g')
            name = ' '.join(filter(None, (record['peer'], record['version'])))
            errors = [number(record[key], '.1e') for key in ERRORS]
            rows.append(
                [name, WORKS[record['work']], time, number(record['ratio'], '.3g'), *errors]
            )
    return table(head, rows)


def outcome(record):
    """Formats a cell: the worst outcome and, unless all states have it, its share of states."""
    word, states = record['outcome'], record.get('states', {})
    total = sum(states.values())
    return word if states.get(word) == total or not total else f'{word} {states[word]}/{total}'


def markdown(results):
    """Formats the page."""
    lines = [INTRODUCTION.format(**results)]
    for mode, title in MODES.items():
        lines += [f'## {title}', '', *speeds(results['records'], mode), '']
    lines += ['## How each program is called', '']
    lines += [f'- **{name}**: {how}' for name, how in results['calls'].items()]
    lines += ['', *(f'Left out: {line}.' for line in results['left_out']), HARD]
    outcomes = results['outcomes']
    names = list(results['situations'])
    peers = dict.fromkeys(record['peer'] for record in outcomes)
    cells = {(record['peer'], record['situation']): outcome(record) for record in outcomes}
    head = ['', *peers]
    lines += table(head, [[name, *(cells[peer, name] for peer in peers)] for name in names])
    lines += ['']
    lines += [f'- **{name}**: {sentence}' for name, sentence in results['situations'].items()]
    return '\n'.join(lines) + '\n'

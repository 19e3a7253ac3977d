# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The results of a run as a page: docs/peers.md is made by this and never by hand."""

WORKS = {'kinematics': 'kinematics', 'torque': 'with torque'}
MODES = {'one': 'One state at a time', 'array': 'Arrays'}
ERRORS = {
    'max_error_position': 'angle, rad',
    'max_error_rate': 'rate, rad/s',
    'max_error_acceleration': 'acceleration, rad/s²',
    'max_error_torque': 'torque, N m',
}
INTRODUCTION = """\
# Peers, measured

What other software makes of the same work, beside this package in one run. This page is written
by

    python benchmarks/peers/run.py --markdown docs/peers.md

on {date}, with {machine[cpu]}, {machine[cores]} cores, {machine[os]}, Python {python},
NumPy {libraries[numpy]}{compiler}.

The work is the four-bar of document 1 (`config/quadrilateral.yaml`) at 150 rpm: angle, rate and
acceleration of coupler and rocker, and where it says so the driving torque. Beside a peer without
torque ours is the kinematics alone, but in arrays ours always includes the torque. A ratio is a
peer's time over ours: above 1, ours is faster. It is the median over
{rounds} rounds in which both take turns on the same machine; set-up and compilation are not
timed. Errors are the largest over {turn} crank angles against 50 digits.
"""
HARD = """\
## Situations

Each peer is asked state by state. *Right*: the angles are within 1e-6 rad of 50 digits, rates and
accelerations within a millionth. *Rates wrong*: the angles alone are. *Wrong branch*: it went over
to the other assembly. *NaN*: not a number, or the exception of a failed operation. *Refused*: an
exception of its own. *Diverged*: a number that is neither assembly, or any number where the loop
cannot close. The worst of all states counts, NaN before wrong branch before diverged, and how many
there were of it. Peers that follow the
motion, and peers that stay on one side, are given the right start.
"""


def table(head, rows):
    """Lines of a table; the first column holds words, the others numbers."""
    yield f'| {" | ".join(head)} |'
    yield f'|---{"|--:" * (len(head) - 1)}|'
    for row in rows:
        yield f'| {" | ".join(row)} |'


def number(value, form):
    """A number, or a dash."""
    return '-' if value is None else format(value, form)


def speeds(records, mode):
    """The table of one way of asking."""
    unit, factor = ('us', 1) if mode == 'one' else ('ns', 1000)
    head = ['', 'work', f'{unit} a state', 'ratio', *ERRORS.values()]
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
    """A cell: the worst outcome, and its share where it is not that of all states."""
    word, states = record['outcome'], record.get('states', {})
    total = sum(states.values())
    return word if states.get(word) == total or not total else f'{word} {states[word]}/{total}'


def markdown(results):
    """The page."""
    lines = [INTRODUCTION.format(**results)]
    for mode, title in MODES.items():
        lines += [f'## {title}', '', *speeds(results['records'], mode), '']
    lines += ['## How each is called', '']
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

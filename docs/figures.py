# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Updates the measured numbers and tables of the pages from the JSON files in this folder.

    python docs/figures.py        updates all pages

Each sentence is found by its words, in which {} stands for a number; a table is between comments
with its name. `linkage_chart accuracy --out docs`, `linkage_chart stability --out docs` and the
programs in benchmarks write the JSON files.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

from linkage_lab.methods.linkage_cases import NEAR
from linkage_lab.methods.registry import DEFAULT, LIVE, METHODS, RECORDS
from linkage_ros.motion.drives.follow import FollowDrive

DOCS = Path(__file__).parent
NUMBER = r'\d+(?:\.\d+)?(?:e-?\d+)?'
Figure: TypeAlias = tuple[str, list[float]]  # a sentence and its numbers

_ONE, _BATCH = 'one at a time', 'batch'
_LONG, _LOOP = 'long free run', 'loop after a long run'
_MULTIPLIERS = [f'multipliers, {how}' for how in ('unstabilised', 'Baumgarte', 'projected')]


def content(name: str) -> Any:
    """Reads a JSON file."""
    return json.loads((DOCS / f'{name}.json').read_text())


def records(name: str) -> list[dict[str, Any]]:
    """Reads the records of a JSON file."""
    whole = content(name)
    found: list[dict[str, Any]] = whole['records'] if isinstance(whole, dict) else whole
    return found


def _points(method: str, mechanism: str, quantity: str, mode: str) -> list[dict[str, Any]]:
    wanted = (method, mechanism, quantity, mode)
    return [
        point for point in records('accuracy')
        if (point['method'], point['mechanism'], point['quantity'], point['mode']) == wanted
    ]  # fmt: skip


def _share(method: str, quantity: str, mode: str) -> float:
    """Returns a method's time on the quadrilateral, relative to the default's time."""
    one, default = (_points(x, 'quadrilateral', quantity, mode)[0] for x in (method, DEFAULT))
    return float(one['us_per_state'] / default['us_per_state'])


def _best(method: str, quantity: str) -> float:
    """Returns the smallest error of a method on the quadrilateral, over all its settings."""
    return min(p['max_error'] for p in _points(method, 'quadrilateral', quantity, _ONE))


def _over_live(method: str, mechanism: str, mode: str, setting: str = '') -> float:
    """Returns an integrator's time, relative to the live default at its default setting."""
    times = [
        point['us_per_state']
        for name, begin in ((method, setting), (LIVE, 'step 0.001,'))
        for point in _points(name, mechanism, 'trajectory', mode)
        if point['setting'].startswith(begin)
    ]
    one, live = times
    return float(one / live)


def _cell(method: str, situation: str) -> float:
    (cell,) = [
        cell for cell in records('stability')
        if (cell['method'], cell['situation']) == (method, situation)
    ]  # fmt: skip
    return float(cell['worst_error'])


def methods_figures() -> list[Figure]:
    """Returns the sentences of methods.md, with their numbers."""
    circles, pump, quadrilateral = 'two circles', 'wind_pump', 'quadrilateral'
    mean, slowest = 'motion', 'motion, slowest ms'
    others = [method.name for method in METHODS if method.name != DEFAULT]
    errors = [p['max_error'] for name in others for p in _points(name, NEAR, 'position', _ONE)]
    single = _points('factored, float32', quadrilateral, 'torque', _BATCH)
    listing = _points("Ghalbi's listing", quadrilateral, 'position', _ONE)
    (vector_c,) = (r['ratio'] for r in records('peers') if r['peer'] == 'C, vector math')
    ratios = [_over_live(name, quadrilateral, mean, 'tolerance 1e-09') for name in _MULTIPLIERS]
    gaps = [_cell(name, _LOOP) for name in _MULTIPLIERS]
    return [
        ('the best of the others is off by {} rad', [min(e for e in errors if e)]),
        (
            "of the quadrilateral in {} of the default's time, and in {} of it for arrays",
            [_share(circles, 'position', mode) for mode in (_ONE, _BATCH)],
        ),
        (
            "the method takes {} of the default's time, and {} of it for arrays",
            [_share(circles, 'torque', mode) for mode in (_ONE, _BATCH)],
        ),
        (
            "If an error of {} is acceptable, `float32` takes {} of the default's time",
            [single[0]['max_error'], _share('factored, float32', 'torque', _BATCH)],
        ),
        (
            "needs {} of the live default's time on the pump, and {} times as long on",
            [_over_live(RECORDS, name, mean) for name in (pump, quadrilateral)],
        ),
        (
            '{} times as long as that of the live default on the pump, and {} times as long on',
            [_over_live(RECORDS, name, slowest) for name in (pump, quadrilateral)],
        ),
        ("take {} times the live default's time without stabilisation", ratios[:1]),
        ("{} times with Baumgarte's, and {} times with projections", ratios[1:]),
        ('they are off by {} rad', [listing[0]['max_error']]),
        (
            'give a rate with an error of {} and an acceleration with an error of {}',
            [_best('central differences', order) for order in ('rate', 'acceleration')],
        ),
        ('to {} crank lengths in the long run', gaps[:1]),
        ('equation keeps it within {}, projections within {}', gaps[1:]),
        ("vectorised C takes {} of this package's time", [vector_c]),
    ]


def dynamics_figures() -> list[Figure]:
    """Returns the sentences of dynamics.md, with their numbers."""
    live = _points(LIVE, 'quadrilateral', 'trajectory', 'motion')
    (each,) = (p['us_per_state'] for p in live if p['setting'].startswith('step 0.001,'))
    late = {r['delay_ticks']: 100 * r['largest_deviation'] for r in records('delay')}
    kinds = RECORDS, LIVE
    return [
        ('takes {} % of a core for the quadrilateral at 150 rpm', [each / 10]),
        (
            'errors of about {} in a record and {} live, for motor lines and guides',
            [max(_cell(k, 'steep motor line'), _cell(k, 'stiff guide')) for k in kinds],
        ),
        ('changes by about {} in a record and {} live', [_cell(k, _LONG) for k in kinds]),
        (
            'pass such points with errors of about {} in a record and {} live',
            [_cell(k, 'stretched dyad') for k in kinds],
        ),
        ('within {} % if the torque is computed for the middle', [late[0.0]]),
        (
            '{} % off if the torque is computed for the start of the tick, and {} % off',
            [late[0.5], late[1.5]],
        ),
    ]


def controllers_figures() -> list[Figure]:
    """Returns the sentences of controllers.md, with their numbers."""
    peaks = [alone['peak_ripple'] / fed['peak_ripple'] for alone, fed in _controlled()]
    return [('are {} to {} times smaller', [min(peaks), max(peaks)])]


FIGURES = {
    'lab/docs/methods.md': methods_figures,
    'docs/dynamics.md': dynamics_figures,
    'docs/controllers.md': controllers_figures,
}


# ---------------------------------------------------------------- tables


def _controlled() -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yields the records of each case, by PI control alone and with feed-forward."""
    found = records('controller')
    yield from zip(found[::2], found[1::2], strict=True)


def effect() -> str:
    """Makes the table of speed errors with and without feed-forward."""
    cases = {
        'as it is': 'as it is',
        '5 % mass error': 'masses 5 % larger in the controller',
        '2 ms extra delay': 'commands 2 ms later, lead 2 ms more',
    }
    rows = []
    for alone, fed in _controlled():
        errors = [100 * one['p99_ripple'] for one in (alone, fed)]
        cells = f'{errors[0]:.1f} %', f'{shown(errors[1])} %', f'{errors[0] / errors[1]:.0f}'
        rows.append((f'{alone["rpm"]:.0f} rpm', cases[alone['case']], *cells))
    return table('speed, plant, PI alone, with feed-forward, ratio', rows)


def commands() -> str:
    """Makes the table of the cost of commands."""
    kinds = {
        'controller': '`linkage_controller`, 1000 a second',
        'no commands': 'none',
        'commands 0.0': '0.0 N m, 1000 a second',
        'commands NaN': 'NaN, rejected, 1000 a second',
    }
    rows = []
    for name, words in kinds.items():
        one = content('inputs')[name]
        source = '-' if name == 'no commands' else f'{one["source_percent"]:.1f} %'
        cells = f'{one["missed_percent"]:.2f} %', f'{one["node_percent"]:.1f} %'
        rows.append((words, *cells, source))
    return table("commands, missed ticks, plant's share of a core, sender's share", rows)


def encoders() -> str:
    """Makes the table of torque errors with a measured crank, by the resolution of the encoder."""
    default, rows = FollowDrive().follow_bandwidth, []
    for bits in (12, 14, 16, 18, 20):
        cells = []
        for velocity in (False, True):
            found = {
                one['follow_bandwidth']: 100 * one['max_error']
                for one in records('accuracy_follow')
                if (one['bits'], one['measured_velocity']) == (bits, velocity)
            }
            best = min(found, key=found.__getitem__)
            cells += [f'{found[default]:.1f} %', f'{found[best]:.1f} % at {best:.0f} Hz']
        rows.append((f'{bits} bit', *cells))
    head = 'encoder, {0} Hz, best angle alone, {0} Hz with measured velocity, best with velocity'
    return table(head.format(f'{default:.0f}'), rows)


def ages() -> str:
    """Makes the table of the response times of a node that follows."""
    rows = []
    for rate, one in content('follow').items():
        cells = [
            cell
            for part in (one['speed'], one['follow'])
            for cell in (
                *(f'{part["age"][key]:.0f}' for key in ('p50', 'p99')),
                f'{part["cpu_percent"]:.1f} %',
            )
        ]
        rows.append((f'{rate} Hz', *cells, str(one['answers'])))
    columns = 'p99 (us), share of a core'
    return table(
        f'rate, robot: median (us), {columns}, follower: median (us), {columns}, answers', rows
    )


def followers() -> str:
    """Makes the table of several nodes that follow one robot."""
    rows = []
    for number in (2, 4):
        one = content('inputs')[f'{number} followers']
        keys = 'robot_percent', 'node_percent', 'answered_percent'
        rows.append(
            (str(number), f'{one["robot_hz"]:.0f} Hz', *(f'{one[key]:.1f} %' for key in keys))
        )
    shares = 'its share of a core, largest share of a node'
    return table(f'following nodes, rate of the robot, {shares}, answered', rows)


def hosts() -> str:
    """Makes the table of network failures between two hosts."""
    kinds = {'cable': 'cable pulled for {} s', 'silent': 'other host gone for {} s, link up'}
    rows = [
        (
            kinds[cut['kind']].format(f'{cut["seconds"]:.0f}'),
            *(f'{cut[key]:.2g} s' for key in ('states_back', 'commands_back')),
            f'{cut["unheard"]} of {cut["logged"]}',
            str(cut['ticks_missed']),
        )
        for cut in content('reliability')['hosts']['cuts']
    ]
    head = 'fault, states resume after, commands resume after, states not received, ticks missed'
    return table(head, rows)


def nodes() -> str:
    """Makes the table of many nodes on one machine."""
    rows = [
        (
            f'{one["nodes"]:.0f}',
            f'{one["found_s"]:.1f} s',
            *(str(one[key]) for key in ('missed', 'missed_at_start')),
            f'{one["cores"]:.2f}',
        )
        for one in content('reliability')['many']
    ]
    head = 'nodes, discovery takes, ticks missed in the next 8 s, during discovery, cores used'
    return table(head, rows)


TABLES: dict[str, list[Callable[[], str]]] = {
    'docs/controllers.md': [effect, commands],
    'docs/follow.md': [ages, followers],
    'docs/reliability.md': [hosts, nodes],
    'lab/docs/measured_crank.md': [encoders],
}
PAGES = sorted({*FIGURES, *TABLES})


def table(head: str, rows: list[tuple[str, ...]]) -> str:
    """Formats a Markdown table."""
    columns = tuple(head.split(', '))
    lines = [columns, ('---',) * len(columns), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def shown(value: float) -> str:
    """Formats a number with two digits; a very small or large number with one and an exponent."""
    if 0.001 < value < 1000:
        return f'{float(f"{value:.2g}"):g}'
    digits, exponent = f'{value:.0e}'.split('e')
    return f'{digits}e{int(exponent)}'


def place(sentence: str, text: str) -> re.Match[str]:
    """Finds the only occurrence of a sentence on a page.

    Raises:
        ValueError: The sentence occurs never, or more than once.
    """
    words = [re.escape(word).replace(r'\{\}', f'({NUMBER})') for word in sentence.split()]
    found = list(re.finditer(r'\s+'.join(words), text))
    if len(found) != 1:
        raise ValueError(f'{len(found)} times on the page, not once: {sentence}')
    return found[0]


def filled(name: str, text: str) -> str:
    """Replaces numbers and tables of a page by those of the JSON files; keeps all other text.

    Raises:
        ValueError: A sentence or the place of a table is missing, or occurs more than once.
    """
    for make in TABLES.get(name, []):
        text, count = re.subn(
            rf'(<!-- table: {make.__name__} -->\n\n).*?(?=\n\n<!-- end -->)',
            lambda place, make=make: place[1] + make(),  # type: ignore[misc]
            text,
            flags=re.DOTALL,
        )
        if count != 1:
            raise ValueError(f'{count} places on the page, not one, for {make.__name__}')
    for sentence, values in FIGURES[name]() if name in FIGURES else []:
        match = place(sentence, text)
        for i, value in reversed(list(enumerate(values, 1))):
            text = text[: match.start(i)] + shown(value) + text[match.end(i) :]
    return text


def main() -> None:
    """Updates the pages."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for name in PAGES:
        page = DOCS.parent / name
        page.write_text(filled(name, page.read_text()))


if __name__ == '__main__':
    main()

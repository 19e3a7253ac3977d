# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Updates the measured numbers of two pages from the JSON files in this folder.

    python docs/figures.py        updates both pages

Each sentence is found by its words, in which {} stands for a number. `linkage_chart accuracy --out
docs`, `linkage_chart stability --out docs` and benchmarks/delay.py write the JSON files.
"""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import Any, TypeAlias

from linkage_lab.methods.linkage_cases import NEAR
from linkage_lab.methods.registry import DEFAULT, LIVE, METHODS, RECORDS

DOCS = Path(__file__).parent
NUMBER = r'\d+(?:\.\d+)?(?:e-?\d+)?'
Figure: TypeAlias = tuple[str, list[float]]  # a sentence and its numbers

_ONE, _BATCH = 'one at a time', 'batch'
_LONG, _LOOP = 'long free run', 'loop after a long run'
_MULTIPLIERS = [f'multipliers, {how}' for how in ('unstabilised', 'Baumgarte', 'projected')]


def records(name: str) -> list[dict[str, Any]]:
    """Reads the records of a JSON file."""
    content = json.loads((DOCS / f'{name}.json').read_text())
    found: list[dict[str, Any]] = content['records'] if isinstance(content, dict) else content
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
    listing = _points("document 1's listing", quadrilateral, 'position', _ONE)
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


FIGURES = {'lab/docs/methods.md': methods_figures, 'docs/dynamics.md': dynamics_figures}


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
    """Replaces the numbers of a page by those of the JSON files; keeps all other text."""
    for sentence, values in FIGURES[name]():
        match = place(sentence, text)
        for i, value in reversed(list(enumerate(values, 1))):
            text = text[: match.start(i)] + shown(value) + text[match.end(i) :]
    return text


def main() -> None:
    """Updates the pages."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for name in FIGURES:
        page = DOCS.parent / name
        page.write_text(filled(name, page.read_text()))


if __name__ == '__main__':
    main()

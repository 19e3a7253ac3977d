# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Updates the tables of measured numbers of the pages from the JSON files in this folder.

    python docs/figures.py        updates all pages

A table is between comments with its name. `linkage_chart accuracy --out docs`, `linkage_chart
stability --out docs` and the programs in benchmarks write the JSON files.
"""

import argparse
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from linkage_ros.motion.drives.follow import FollowDrive

DOCS = Path(__file__).parent


def content(name: str) -> Any:
    """Reads a JSON file."""
    return json.loads((DOCS / f'{name}.json').read_text())


def records(name: str) -> list[dict[str, Any]]:
    """Reads the records of a JSON file."""
    whole = content(name)
    found: list[dict[str, Any]] = whole['records'] if isinstance(whole, dict) else whole
    return found


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
    'docs/follow.md': [ages],
    'docs/reliability.md': [hosts, nodes],
    'lab/docs/measured_crank.md': [encoders],
}


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


def filled(name: str, text: str) -> str:
    """Replaces the tables of a page by those of the JSON files; keeps all other text.

    Raises:
        ValueError: The place of a table is missing, or occurs more than once.
    """
    for make in TABLES[name]:
        text, count = re.subn(
            rf'(<!-- table: {make.__name__} -->\n\n).*?(?=\n\n<!-- end -->)',
            lambda place, make=make: place[1] + make(),  # type: ignore[misc]
            text,
            flags=re.DOTALL,
        )
        if count != 1:
            raise ValueError(f'{count} places on the page, not one, for {make.__name__}')
    return text


def main() -> None:
    """Updates the pages."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for name in TABLES:
        page = DOCS.parent / name
        page.write_text(filled(name, page.read_text()))


if __name__ == '__main__':
    main()

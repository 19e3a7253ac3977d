# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Updates the tables of the reference pages of linkage_ros and of its laboratory.

    python docs/reference.py        updates docs/reference.md and lab/docs/reference.md

The tables come from the declarations in the code; the text between them is written by hand. The
script requires the extra ros.
"""

import argparse
import ast
import json
import re
import runpy
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING
from functools import partial
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from typing import cast
from unittest.mock import MagicMock, patch

from linkage_lab import command_line, export
from linkage_lab.charts.stability import GRIDS
from linkage_lab.robots import import_tool
from linkage_ros import executables
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.parts import TracedPoint
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.topics import (
    CRANK_TRAJECTORY,
    EFFORT_COMMANDS,
    JOINT_COMMANDS,
    MEASURED_JOINT_STATES,
    SIMULATED_CLOCK,
    TOPICS,
    TRAJECTORY_COMMANDS,
    WRENCHES,
)
from linkage_ros.motion.drives import DRIVES
from linkage_ros.quantities import Leaf, leaves
from linkage_ros.settings.controller import ControllerSettings
from linkage_ros.settings.help import PARSERS
from linkage_ros.settings.joints import JointSettings
from linkage_ros.settings.parameters import MechanismAndDrive, Session
from linkage_ros.settings.presets import preset_names, preset_path

_ROOT = Path(__file__).parents[1]
PAGES = 'docs/reference.md', 'lab/docs/reference.md'

# A table is between a comment with its name and an end comment.
_PLACE = re.compile(r'(?<=<!-- table: )(\w+)( -->\n\n).*?(?=\n\n<!-- end -->)', re.DOTALL)


def _table(head: str, rows: Iterable[Iterable[str]]) -> str:
    """Formats a Markdown table."""
    columns = head.split(', ')
    lines = [columns, ['---'] * len(columns), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


# ---------------------------------------------------------------- parameters


def _parameters(cls: type, prefix: str = '') -> str:
    """Makes the table of the parameters that a class declares."""
    return _table('name, value, default, meaning', map(parameter_row, leaves(cls, prefix)))


def parameter_row(leaf: Leaf) -> tuple[str, str, str, str]:
    """Makes the row of a parameter: name, valid values, default and meaning."""
    name, quantity, default = leaf
    span = re.sub(r'e\+?(-?)0*', r'e\1', quantity.span)  # 1e-9, not 1e-09
    values = {
        'number': span,
        'whole': span,
        'pair': f'two, {span}',
        'list': f'a list, each {span}',
        'choice': ', '.join(f'`{word}`' for word in quantity.choices),
        'text': f'`{quantity.pattern}`' if quantity.pattern else 'text',
        'names': 'a list of names',
        'switch': '`true`, `false`',
    }[quantity.kind]
    shown = {MISSING: 'required', None: '-', '': "`''`"}.get(default)
    if shown is None:
        shown = f'`{default if isinstance(default, str) else json.dumps(default)}`'
    live = '; may be set while the node runs' if quantity.live else ''
    return f'`{name}`', values, shown, quantity.meaning + live


def _presets() -> str:
    """Makes the table of presets, from the comment at the top of each file."""
    rows = []
    for name in preset_names():
        lines = takewhile(
            lambda line: line[:2] == '# ', preset_path(name).read_text().splitlines()
        )
        words = ' '.join(line[2:] for line in lines)
        rows.append((f'[`{name}`](../config/{name}.yaml)', words))
    return _table('preset, description', rows)


def _sections(word: str, classes: Mapping[str, type]) -> str:
    """Makes a heading and a table for each class."""
    return '\n\n'.join(
        f'#### `{word}: {name}`\n\n{_parameters(cls)}' for name, cls in classes.items()
    )


# ---------------------------------------------------------------- topics


def _topics() -> str:
    rows = []
    commands = JOINT_COMMANDS, MEASURED_JOINT_STATES, CRANK_TRAJECTORY
    subscribed = *commands, WRENCHES, SIMULATED_CLOCK
    for topic in (*TOPICS, EFFORT_COMMANDS, TRAJECTORY_COMMANDS, *subscribed):
        direction = ' (subscribed)' if topic in subscribed else ''
        latched = '; transient local' * topic.latched
        kind = topic.interface.name.replace('/msg/', '/')
        rows.append((f'`{topic.name}`{direction}', kind, topic.meaning + latched))
    return _table('topic, type, content', rows)


# ---------------------------------------------------------------- executables


def programs() -> dict[str, argparse.ArgumentParser]:
    """Returns the argument parser of each executable, by name."""
    starts = [value.args for value in vars(executables).values() if isinstance(value, partial)]
    return {
        name: PARSERS[module]()
        if module in PARSERS
        else import_module(f'linkage_ros.{module}')._parser()  # noqa: SLF001
        for name, module in starts
    }


def _executables(parsers: Mapping[str, argparse.ArgumentParser]) -> str:
    return '\n\n'.join(
        part for name, parser in parsers.items() for part in _command(f'### `{name}`', parser)
    )


def _command(heading: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yields heading, purpose, usage line and table of arguments; recurses into subcommands."""
    yield heading
    words = ' '.join((parser.description or '').split())
    yield f'{words[0].upper()}{words[1:].rstrip(".")}.'
    actions = [a for a in parser._actions if a.dest not in ('help', 'version', 'words')]  # noqa: SLF001
    for group in actions:
        if isinstance(group, argparse._SubParsersAction):  # noqa: SLF001
            for name, command in group.choices.items():
                yield from _command(f'#### `{parser.prog} {name}`', command)
            return
    # Positional arguments first, as in the usage line.
    actions.sort(key=lambda action: bool(action.option_strings))
    if actions:
        places = [_usage(a) for a in actions if a.required or not a.option_strings]
        yield f'    {" ".join([parser.prog, *places, "[options]"])}'
        yield _table('argument, meaning', [(f'`{_usage(a)}`', a.help or '') for a in actions])


def _usage(action: argparse.Action) -> str:
    """Formats an argument as in a usage line."""
    value = action.metavar if isinstance(action.metavar, str) else action.dest.upper()
    if not action.option_strings:
        return f'[{value}]' if action.nargs == '?' else value
    names = ', '.join(action.option_strings)
    shapes = {0: names, '?': f'{names} [{value}]', '+': f'{names} {value} ...'}
    if isinstance(action.nargs, int) and action.nargs > 1:
        parts = action.metavar if isinstance(action.metavar, tuple) else (value,) * action.nargs
        return ' '.join((names, *parts))
    return shapes.get(action.nargs, f'{names} {value}')


# ---------------------------------------------------------------- launch files


def launch_arguments(path: Path) -> dict[str, tuple[str | None, str]]:
    """Returns default and meaning of the arguments of a launch file, by name.

    The file runs with mocks of ROS's launch modules, which need not be installed.
    """
    names = ('launch', 'launch.actions', 'launch_ros', 'launch_ros.actions')
    modules = {name: MagicMock() for name in names}
    with patch.dict(sys.modules, modules):
        return cast('dict[str, tuple[str | None, str]]', runpy.run_path(str(path))['ARGUMENTS'])


def _launch_files() -> str:
    return '\n\n'.join(
        part for path in sorted((_ROOT / 'launch').glob('*.py')) for part in _launch(path)
    )


def _launch(path: Path) -> Iterator[str]:
    yield f'### `{path.name}`'
    purpose, _, example = (ast.get_docstring(ast.parse(path.read_text())) or '').partition('\n\n')
    yield purpose
    yield f'    {example}'
    rows = [
        (f'`{name}`', f'`{default}`' if default else '-' if default == '' else 'required', meaning)
        for name, (default, meaning) in launch_arguments(path).items()
    ]
    yield _table('argument, default, meaning', rows)


# ---------------------------------------------------------------- the pages


def _methods() -> str:
    """Makes the table of the methods that `linkage_chart accuracy` and `stability` compare."""
    methods = [method for methods, _ in GRIDS for method in methods]
    return _table(
        'method, computes, needs, source', ((m.name, m.stage, m.needs, m.source) for m in methods)
    )


def tables() -> dict[str, str]:
    """Makes all tables, by the names in the comments of the pages."""
    return {
        'presets': _presets(),
        'kind': _parameters(MechanismAndDrive),
        'mechanisms': _sections('mechanism', MECHANISMS),
        'points': _parameters(TracedPoint, 'points.<name>.'),
        'loads': _sections('kind', LOADS),
        'drives': _sections('drive', DRIVES),
        'session': _parameters(Session),
        'joints': _parameters(JointSettings, 'joints.<link>.'),
        'controller': _parameters(ControllerSettings),
        'topics': _topics(),
        'executables': _executables(programs()),
        'launch': _launch_files(),
        'charts': _executables(
            {
                'linkage_chart': command_line._parser(),  # noqa: SLF001
                'linkage_export': export._parser(),  # noqa: SLF001
                'linkage_import': import_tool._parser(),  # noqa: SLF001
            }
        ),
        'methods': _methods(),
    }


def filled(text: str) -> str:
    """Replaces the tables of a page; keeps the text around them."""
    made = tables()
    return _PLACE.sub(lambda place: place[1] + place[2] + made[place[1]], text)


def main() -> None:
    """Updates the pages."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for name in PAGES:
        page = _ROOT / name
        page.write_text(filled(page.read_text()))


if __name__ == '__main__':
    main()

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart new: a parameter file to start from, with a comment for each parameter."""

import argparse
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING

from linkage_ros import ConfigurationError, TracedPoint
from linkage_ros.extensions import LOADS
from linkage_ros.internals import MechanismAndDrive, configure, parameter_leaves
from linkage_ros.quantities import Leaf, Quantity, did_you_mean, leaves, shown

_COLUMN = 44  # of the comments
_HUGE = 1e5  # bounds of a range beyond this are not shown
# Values that the file gives, by kind of mechanism; the other parameters are commented out.
STARTS: dict[str, dict[str, object]] = {
    'four_bar': {
        'rpm': 60.0, 'frame.length': 0.3, 'crank.length': 0.1, 'coupler.length': 0.25,
        'coupler.mass': 1.0, 'coupler.inertia': 0.006, 'coupler.center': [0.125, 0.0],
        'rocker.length': 0.2,
    },
    'slider_crank': {
        'rpm': 60.0, 'crank.length': 0.1, 'coupler.length': 0.3, 'slider.mass': 1.0,
    },
    'inverted_slider_crank': {
        'rpm': 60.0, 'frame.length': 0.3, 'frame.angle': -1.5707963267948966,
        'crank.length': 0.1, 'barrel.mass': 2.0, 'barrel.inertia': 0.05,
        'barrel.center': [0.2, 0.0],
    },
    'wind_pump': {
        'drive': 'torque', 'start_rpm': 20.0, 'assembly': 'crossed',
        'motor.torque': 8.4, 'motor.damping': 1.2, 'crank.length': 0.12, 'crank.inertia': 20.0,
        'coupler.length': 0.8, 'coupler.mass': 40.0, 'coupler.inertia': 1.2,
        'rod.length': 1.6, 'rod.mass': 4.0, 'rod.inertia': 0.85, 'slider.mass': 6.0,
        'slider.position': 1.5,
    },
    'drawing': {
        'rpm': 60.0, 'drawing.units': 'mm', 'drawing.input': 'crank',
        'drawing.frame': ['A0', 'B0'],
        'drawing.pins.A0': [0.0, 0.0], 'drawing.pins.A': [30.0, 40.0],
        'drawing.pins.B': [120.0, 90.0], 'drawing.pins.B0': [140.0, 0.0],
        'drawing.pins.P': [80.0, 120.0], 'drawing.pins.S': [260.0, 30.0],
        'drawing.links.crank.pins': ['A0', 'A'], 'drawing.links.coupler.pins': ['A', 'B', 'P'],
        'drawing.links.rocker.pins': ['B', 'B0'], 'drawing.links.conrod.pins': ['B', 'S'],
        'drawing.slides.ram.pin': 'S', 'drawing.slides.ram.direction': [1.0, 0.0],
        'drawing.slides.ram.mass': 2.0,
    },
}  # fmt: skip


def new(options: argparse.Namespace) -> None:
    """Prints a parameter file.

    Raises:
        ConfigurationError: The kind is unknown.
    """
    if options.kind not in STARTS:
        hint = did_you_mean(options.kind, STARTS)
        raise ConfigurationError(
            f'{shown(options.kind)}: must be one of {", ".join(STARTS)}{hint}'
        )
    print(parameter_file(options.kind))


def parameter_file(kind: str) -> str:
    """Writes a parameter file with all parameters of a mechanism and its usual drive.

    Returns:
        YAML text. Those parameters that are not needed are commented out, with their defaults.
    """
    values = {'mechanism': kind, **STARTS[kind]}
    choice = MechanismAndDrive(kind, str(values.get('drive', 'speed')))
    known = [x for x in parameter_leaves(choice, values) if not x.name.startswith('joints.')]
    lines = [
        f'# Parameters of a mechanism of kind {kind}; angles in rad, or written 85deg.',
        '# Remove the # before a parameter to change it.',
        '/**:',
        '  ros__parameters:',
        *_tree(known, values, configure(values).parameters()),
        '',
        '    # Also, by names of your own, any number of points whose paths are traced:',
        '    # points:',
        f'    #   NAME: {_flow(leaves(TracedPoint))}',
        '    # and of loads; linkage_record --help-parameters explains them, dyads and joints:',
        '    # loads:',
        *(f'    #   NAME: {_flow(leaves(load), kind=name)}' for name, load in LOADS.items()),
    ]
    return '\n'.join(lines)


def _tree(
    known: Iterable[Leaf], values: Mapping[str, object], defaults: Mapping[str, object]
) -> Iterator[str]:
    """Yields a line for each group and each parameter.

    Args:
        known: All parameters of the mechanism and its drive.
        values: Values that the file gives, by dotted name.
        defaults: Values of all parameters, by dotted name.
    """
    groups_before = list[str]()
    explained = set[tuple[str, ...]]()
    for name, quantity, _ in known:
        *groups, key = name.split('.')
        explanation = _explanation_key(groups, key)
        is_first = explanation not in explained
        explained.add(explanation)
        if not is_first and name not in values:
            continue
        for i, group in enumerate(groups):
            path = groups[: i + 1]
            if groups_before[: i + 1] != path:  # the group begins here
                start = '.'.join(path) + '.'
                has_value = any(x.startswith(start) for x in values)
                yield _line(i, f'{group}:', is_given=has_value)
        groups_before = groups
        value = values.get(name, defaults.get(name))
        words = _words(quantity) if is_first else ''
        text = '' if value is None else f' {_text(value)}'
        yield _line(len(groups), f'{key}:{text}', words, is_given=name in values)


def _explanation_key(groups: Sequence[str], key: str) -> tuple[str, ...]:
    """Returns a key that is the same for parameters that need one explanation.

    These are all pins of a drawing, and the same parameter of all its links and of all its slides.
    """
    if groups == ['drawing', 'pins']:
        return 'drawing', 'pins'
    return *groups[:2], *groups[3:], key  # without the name of the link


def _words(quantity: Quantity) -> str:
    """Describes a parameter; its range only if a user might leave it."""
    words = quantity.meaning
    if quantity.kind == 'choice':
        words += f': {", ".join(quantity.choices)}'
    elif abs(quantity.low) < _HUGE and abs(quantity.high) < _HUGE:
        words += f', {quantity.span}'
    elif quantity.unit:
        words += f', {quantity.unit}'
    return words


def _line(depth: int, text: str, comment: str = '', *, is_given: bool) -> str:
    mark = '' if is_given else '# '
    line = f'    {mark}{"  " * depth}{text}'
    return f'{line:<{_COLUMN}} # {comment}' if comment else line


def _flow(known: Iterable[Leaf], **first: str) -> str:
    """Writes parameters in one line, with three dots for those without a default."""
    parts = dict[str, str](first)
    for name, _, default in known:
        parts[name] = '...' if default is MISSING or default is None else _text(default)
    return '{' + ', '.join(f'{name}: {text}' for name, text in parts.items()) + '}'


def _text(value: object) -> str:
    """Writes a value in YAML."""
    if isinstance(value, str):
        return value or "''"
    if isinstance(value, (list, tuple)):
        return '[' + ', '.join(map(_text, value)) + ']'
    return json.dumps(value)

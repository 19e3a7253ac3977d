# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters in the text of --help, from their declarations."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import MISSING, replace

from linkage_ros.model.registry import MECHANISMS
from linkage_ros.parameters.configuration import MechanismAndDrive, parameter_leaves
from linkage_ros.quantities import Leaf, Quantity

_LARGE = 1e6  # from here on powers of ten are easier to read


def help_on(parameters: Iterable[Leaf]) -> str:
    """Describes parameters in a line each: name, valid values, meaning and default.

    Args:
        parameters: Parameters of any dataclass of quantities.

    Returns:
        The lines.
    """
    return '\n'.join(
        f'  {name}: {_values(quantity)}{quantity.meaning}{_default(default)}'
        for name, quantity, default in parameters
    )


def _values(quantity: Quantity) -> str:
    """The valid values, shorter than in an error message; empty where any text is valid."""
    return {
        'pair': f'two, {quantity.span}; ',
        'choice': f'{", ".join(quantity.choices)}; ',
        'text': f'{quantity.pattern}; ' if quantity.pattern else '',
        'switch': 'true, false; ',
    }.get(quantity.kind, f'{quantity.span}; ')


def _default(value: object) -> str:
    """The default as a user would type it; empty if the meaning explains it."""
    if value is MISSING:
        return ' (required)'
    if value in (None, ''):
        return ''
    if isinstance(value, float) and value >= _LARGE:
        return f' (default {value:.1e})'.replace('e+', 'e')
    return f' (default {value if isinstance(value, str) else json.dumps(value)})'


def help_on_every_kind() -> str:
    """Describes the parameters of a four_bar at a given speed, then those of other kinds."""
    usual = MechanismAndDrive('four_bar', 'speed')
    leaves = parameter_leaves(usual)
    parts = ['parameters of a four_bar:', help_on(leaves)]
    known = {leaf.name for leaf in leaves}
    mechanisms = (('mechanism', name) for name in MECHANISMS if name != usual.mechanism)
    for name, value in (('drive', 'torque'), *mechanisms):
        found = parameter_leaves(replace(usual, **{name: value}))
        parts.append(f'with {name}:={value}, beside some of these:')
        parts.append(help_on(leaf for leaf in found if leaf.name not in known))
    return '\n'.join(parts)

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names of this package's parameters, to tell those that a shared file has for other programs."""

import difflib
import warnings
from collections.abc import Collection
from pathlib import Path

from linkage_ros.errors import ConfigurationError, ParameterWarning
from linkage_ros.settings.controller import PARAMETERS
from linkage_ros.settings.linkages import LINKAGES, first_parts
from linkage_ros.settings.old_names import has_old_names
from linkage_ros.settings.yaml_file import (
    Parameters,
    listed,
    read_parameter_file,
    shared_names,
)

# A misspelt name differs little in length; base_frame does not mean frame.
_LONGER = 2


def read_own_parameters(
    path: Path | str, node_name: str = 'linkage_node', *, for_ros: bool = False
) -> Parameters:
    """Reads a parameter file without the parameters of other programs; see `names_of_others`.

    Arguments are those of `read_parameter_file`.

    Warns:
        ParameterWarning: As for `read_parameter_file`; or there are parameters of other programs.

    Raises:
        ConfigurationError: As for `read_parameter_file`; or there are no other parameters.
    """
    values = read_parameter_file(path, node_name, for_ros=for_ros)
    others = names_of_others(values, path, node_name)
    if not others:
        return values
    node = f'/{node_name.strip("/")}'
    cure = f'write {node} above those that are for it'
    words = f'below /**, no parameters of linkage_ros: {listed(others)}; {cure}'
    if len(others) == len(values):
        raise ConfigurationError(f'{path} has nothing for {node}, {words}')
    warnings.warn(f'{path} has, {words}', ParameterWarning, stacklevel=2)
    return {name: value for name, value in values.items() if name not in others}


def names_of_others(values: Parameters, path: Path | str, node_name: str) -> list[str]:
    """Returns the parameters of other programs that a file has below /**, for all nodes.

    The first part of such a name neither is a name of this package nor resembles one. `values`
    are the parameters that the file gives the node.
    """
    own = first_parts() | {leaf.name for leaf in PARAMETERS}
    linkages = values.get(LINKAGES)
    own |= frozenset(map(str, linkages) if isinstance(linkages, list) else ())
    return [
        name
        for name in sorted(shared_names(path, node_name))
        if not _is_like(name.partition('.')[0], own) and not has_old_names({name: values[name]})
    ]


def _is_like(word: str, own: Collection[str]) -> bool:
    """Returns whether a word is one of this package's, or such a word misspelt."""
    alike = [known for known in own if abs(len(known) - len(word)) <= _LONGER]
    return word in own or bool(difflib.get_close_matches(word, alike))

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A configuration as text that loses nothing, as a log keeps it."""

from __future__ import annotations

import json
from collections.abc import Mapping

from linkage_ros.errors import ConfigurationError
from linkage_ros.parameters.configuration import Configuration, configure


def to_strings(configuration: Configuration) -> dict[str, str]:
    """All settings of a configuration: JSON values by parameter name."""
    return {name: json.dumps(value) for name, value in configuration.parameters().items()}


def from_strings(strings: Mapping[str, str]) -> Configuration:
    """The configuration that `to_strings` wrote down.

    Args:
        strings: JSON values by parameter name.

    Returns:
        The configuration.

    Raises:
        ConfigurationError: A value is not JSON, or the configuration is bad.
    """
    try:
        values = {name: json.loads(text) for name, text in strings.items()}
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f'the logged configuration is not JSON: {error}') from error
    if 'mechanism' not in values:
        raise ConfigurationError('mechanism is missing from the logged configuration')
    return configure(values)

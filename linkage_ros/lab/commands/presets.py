# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The presets on which linkage_chart measures methods."""

from __future__ import annotations

from typing import TypeVar, cast

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.methods.problems import ChartMechanisms
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.structure import Mechanism
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Drive, TorqueDrive
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import preset_path

_Kind = TypeVar('_Kind', bound=Mechanism)


def preset(name: str, kind: type[_Kind]) -> tuple[_Kind, Drive]:
    """A mechanism that the charts take for known.

    Args:
        name: Of the preset.
        kind: Of its mechanism.

    Returns:
        The mechanism, and its drive.

    Raises:
        ConfigurationError: A workspace has a preset of this name, with another kind of mechanism.
    """
    configuration = load(name)
    mechanism = configuration.mechanism
    if not isinstance(mechanism, kind):
        raise ConfigurationError(
            f'{preset_path(name)} describes a {configuration.kind.mechanism} in place of the '
            f"package's {name}: rename it"
        )
    return mechanism, configuration.drive


def moving_presets() -> ChartMechanisms:
    """The quadrilateral, and the wind pump with its motor, for motions under a torque.

    Raises:
        ConfigurationError: As `preset`.
    """
    quadrilateral, _ = preset('quadrilateral', FourBar)
    pump, drive = preset('wind_pump', WindPump)
    # A wind pump has no other drive.
    return ChartMechanisms(quadrilateral, pump, cast('TorqueDrive', drive).motor)

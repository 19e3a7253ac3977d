# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of linkage_controller."""

from dataclasses import dataclass

from linkage_ros.quantities import Checked, leaves, quantity
from linkage_ros.settings.parameters import JOINT_PREFIX
from linkage_ros.settings.presets import DEFAULT_PRESET


@dataclass(frozen=True)
class ControllerSettings(Checked):
    """The parameters of linkage_controller."""

    plant: str = quantity(
        'text', 'parameter file, or preset, of the controlled mechanism',
        default=DEFAULT_PRESET,
    )  # fmt: skip
    linkage: str = quantity('text', 'the controlled linkage, if the plant has several', default='')
    rpm: float = quantity('number', 'crank speed to keep', 'rpm', span=(-1e6, 1e6), default=150.0)
    bandwidth: float = quantity(
        'number', 'bandwidth of the speed loop', 'Hz', span=(0.0, 1e6), default=15.0
    )
    feed_forward: bool = quantity('switch', 'whether the exact torque is added', default=True)
    lead_time: float = quantity(
        'number', 'delay from a measurement to the middle of the period of its command', 's',
        span=(0.0, 10.0), default=0.0015,
    )  # fmt: skip
    joint_prefix: str | None = quantity(
        'text', "prefix of the plant's joints; default: joint_prefix in plant's parameter file",
        pattern=JOINT_PREFIX, default=None,
    )  # fmt: skip


PARAMETERS = leaves(ControllerSettings)

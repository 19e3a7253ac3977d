# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The presets on which linkage_chart measures methods."""

from __future__ import annotations

from typing import cast

from linkage_ros.lab.reference.problems import ChartMechanisms
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.parameters.configuration import load


def solved_presets() -> tuple[FourBar, SliderCrank]:
    """The quadrilateral and the slider-crank, for methods of solving."""
    return (
        cast('FourBar', load('quadrilateral').mechanism),
        cast('SliderCrank', load('slider_crank').mechanism),
    )


def moving_presets() -> ChartMechanisms:
    """The quadrilateral, and the wind pump with its motor, for motions under a torque."""
    pump = load('wind_pump')
    return ChartMechanisms(
        solved_presets()[0],
        cast('WindPump', pump.mechanism),
        cast('TorqueDrive', pump.drive).motor,
    )

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart pump: steady states of a wind pump, for various starts and motor torques."""

import argparse
from typing import Any, cast

from linkage_lab.output import (
    DPI,
    name_of,
    new_file,
    pictures,
    progress,
    save_records,
)
from linkage_lab.pump.analysis import analyse
from linkage_ros import ConfigurationError, WindPump, load


def pump(options: argparse.Namespace) -> None:
    """Finds the steady states of a wind pump, draws them, and writes their numbers.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: The mechanism is not a wind pump, or a file cannot be written.
    """
    configuration = load(options.params).linkage(options.linkage)
    mechanism, drive = configuration.mechanism, cast('Any', configuration.drive)
    if not isinstance(mechanism, WindPump):
        raise ConfigurationError(f'{options.params} is not a wind_pump: try the preset wind_pump')
    name, motor = name_of(options.params, configuration), drive.motor
    records = new_file(options, options.out / f'{name}_settled.json')
    drawn = pictures(options, f'{name}_settled')
    found = analyse(
        mechanism, motor.torque, motor.damping, speeds=options.speeds, progress=progress
    )
    from linkage_lab.pump.chart import draw_pump, states_table

    save_records(records, [found.record()])
    draw_pump(found, f'{name}: {motor}', drawn, DPI / 2 if options.quick else DPI)
    print(records, *states_table(found), *drawn.paths, sep='\n')

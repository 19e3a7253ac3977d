# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart economy: the torque of one mechanism without each of its terms, over speed."""

from __future__ import annotations

import argparse

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.charts.economy import draw_economy
from linkage_ros.lab.commands.output import folder, progress, save_records
from linkage_ros.lab.economy import Economy
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import find_file

_FACTORS = 0.25, 0.5, 1.0, 2.0, 4.0  # of the mechanism's own speed, where none are given


def economy(options: argparse.Namespace) -> None:
    """Leaves out each term at each speed, draws the errors and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: No speed is given, or the folder cannot be written.
        MechanismError: The crank angle does not determine the motion, or nothing needs a torque.
    """
    configuration, name = load(options.params), find_file(options.params).stem
    given = options.rpm or []
    own = getattr(configuration.drive, 'rpm', given[0] if given else 0.0)  # of the summary
    rpms = sorted({own, *(given or (own * factor for factor in _FACTORS))})
    if 0.0 in rpms:
        raise ConfigurationError(
            f'{options.params} at 0 rpm: a crank at rest, or without a speed of its own, has no '
            'turn to compare; choose speeds, such as --rpm 30 60'
        )
    records, picture = (options.out / f'{name}_economy.{suffix}' for suffix in ('json', 'png'))
    measured = Economy(configuration.mechanism, name)
    with folder(options.out):
        savings = measured.measure(rpms, 20 if options.quick else 200, progress)
        sentence = measured.sentence(own, options.tolerance, savings)
        save_records(records, [saving._asdict() for saving in savings])
        draw_economy(savings, sentence, own, options.tolerance, picture)
    print(f'{name}: {sentence}', records, picture, sep='\n')

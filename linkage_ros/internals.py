# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names for linkage_lab alone; they may change in any release.

They are the formulas, integrators and filter that it compares with others, and what it shares with
other programs: laws, periods, ranges of loads, drawing, URDF, notes, files, angles and units.
"""

from pathlib import Path
from typing import Any

from linkage_ros.errors import printable
from linkage_ros.files import (
    LARGEST,
    STANDARD_OUTPUT,
    is_same_file,
    replacement,
    require_new,
    text_output,
)
from linkage_ros.mechanism.axes import axes_of, spin_of
from linkage_ros.mechanism.dyad_reach import reach_of
from linkage_ros.mechanism.equations import Model, acting_forces, torque
from linkage_ros.mechanism.exact import UNITS
from linkage_ros.mechanism.joint_forces import reactions
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.mechanism.rigid_links import rigid_links
from linkage_ros.mechanism.travel import extremes_between
from linkage_ros.mechanism.wrenches import FRAME, poses
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.motion.along_law import LawMotion, reversals
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.measured import TrackingFilter
from linkage_ros.motion.steps import live_steps, record_steps
from linkage_ros.motion.under_torque import Motor, published
from linkage_ros.numeric import without_turns, wrap
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import (
    Configuration,
    Linkage,
    configuration_of,
    configure,
    read_values,
)
from linkage_ros.settings.notes import notes_on
from linkage_ros.settings.old_names import new_name
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves
from linkage_ros.settings.yaml_file import read_yaml
from linkage_ros.units import radians_per_second
from linkage_ros.view.picture import Picture
from linkage_ros.xml_file import read_xml


def logged_states(path: Path | str, most: int, linkage: str = '') -> Any:
    """Reads the first states of a linkage in a log; see `linkage_ros.log.tables.logged_states`."""
    from linkage_ros.log import tables  # needs MCAP

    return tables.logged_states(path, most, linkage)


__all__ = [
    'FRAME',
    'LARGEST',
    'STANDARD_OUTPUT',
    'UNITS',
    'Configuration',
    'DrivenMechanism',
    'LawMotion',
    'Linkage',
    'MechanismAndDrive',
    'Model',
    'Motor',
    'Picture',
    'Ranges',
    'Simulator',
    'TrackingFilter',
    'acting_forces',
    'axes_of',
    'configuration_of',
    'configure',
    'extremes_between',
    'is_same_file',
    'live_steps',
    'logged_states',
    'make_urdf',
    'new_name',
    'notes_on',
    'parameter_leaves',
    'poses',
    'printable',
    'published',
    'radians_per_second',
    'reach_of',
    'reactions',
    'read_values',
    'read_xml',
    'read_yaml',
    'record_steps',
    'replacement',
    'require_new',
    'reversals',
    'rigid_links',
    'spin_of',
    'text_output',
    'torque',
    'without_turns',
    'wrap',
]

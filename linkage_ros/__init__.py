# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact motion and driving torque of planar linkages, with a ROS 2 node, logs, replay and viewer.

Create a mechanism (such as a `FourBar` or a `Drawing`) and pass it to a `Solver`,
which computes states, accelerations, joint forces and energy. Units are SI: m, kg, rad, s, N.
Angles and torques are positive counter-clockwise. Coordinates and rates may be floats or arrays.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, overload

__version__ = '2.0.0'

if TYPE_CHECKING:
    from pathlib import Path

    from linkage_ros.errors import (
        ConfigurationError,
        LinkageError,
        LogError,
        MechanismError,
        MotionError,
        UnreachableError,
        ViewerError,
    )
    from linkage_ros.mechanism.base import Mechanism
    from linkage_ros.mechanism.conditions import Conditions
    from linkage_ros.mechanism.drawing import (
        Drawing,
        DrawnCylinder,
        DrawnLink,
        DrawnMass,
        DrawnSlide,
    )
    from linkage_ros.mechanism.dyads import Dyad, DyadSlider
    from linkage_ros.mechanism.four_bar import FourBar
    from linkage_ros.mechanism.inverted_slider_crank import InvertedSliderCrank
    from linkage_ros.mechanism.joint_forces import Reactions
    from linkage_ros.mechanism.kinematics import PointMotion, Reach, State
    from linkage_ros.mechanism.loads.curve import LoadCurve
    from linkage_ros.mechanism.loads.force import Force
    from linkage_ros.mechanism.loads.friction import Friction
    from linkage_ros.mechanism.loads.gas import Gas
    from linkage_ros.mechanism.loads.link_load import LinkLoad
    from linkage_ros.mechanism.loads.pins import Pins
    from linkage_ros.mechanism.loads.spring import Spring
    from linkage_ros.mechanism.parts import (
        CROSSED,
        OPEN,
        Barrel,
        Body,
        Coupler,
        Frame,
        Guide,
        Piston,
        Rocker,
        Rod,
        Slider,
        TracedPoint,
    )
    from linkage_ros.mechanism.slider_crank import SliderCrank
    from linkage_ros.mechanism.solver import Solver
    from linkage_ros.mechanism.travel import Travel, travel
    from linkage_ros.mechanism.wind_pump import WindPump
    from linkage_ros.numeric import Array
    from linkage_ros.settings.configuration import Configuration
    from linkage_ros.settings.presets import preset_names

# Names are imported when they are first used, so that `--help` of a program needs no NumPy.
_MODULES = {
    name: module
    for module, names in {
        'errors': (
            'ConfigurationError LinkageError LogError MechanismError MotionError '
            'UnreachableError ViewerError'
        ),
        'mechanism.base': 'Mechanism',
        'mechanism.conditions': 'Conditions',
        'mechanism.drawing': 'Drawing DrawnCylinder DrawnLink DrawnMass DrawnSlide',
        'mechanism.dyads': 'Dyad DyadSlider',
        'mechanism.four_bar': 'FourBar',
        'mechanism.inverted_slider_crank': 'InvertedSliderCrank',
        'mechanism.joint_forces': 'Reactions',
        'mechanism.kinematics': 'PointMotion Reach State',
        'mechanism.loads.curve': 'LoadCurve',
        'mechanism.loads.force': 'Force',
        'mechanism.loads.friction': 'Friction',
        'mechanism.loads.gas': 'Gas',
        'mechanism.loads.link_load': 'LinkLoad',
        'mechanism.loads.pins': 'Pins',
        'mechanism.loads.spring': 'Spring',
        'mechanism.parts': (
            'CROSSED OPEN Barrel Body Coupler Frame Guide Piston Rocker Rod Slider TracedPoint'
        ),
        'mechanism.slider_crank': 'SliderCrank',
        'mechanism.solver': 'Solver',
        'mechanism.travel': 'Travel travel',
        'mechanism.wind_pump': 'WindPump',
        'settings.presets': 'preset_names',
    }.items()
    for name in names.split()
}


if not TYPE_CHECKING:  # type checkers know the names above, and report others

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        value = getattr(import_module(f'linkage_ros.{_MODULES[name]}'), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return [*__all__, '__version__']


def load(source: str, *, checks_drive: bool = True) -> 'Configuration':
    """Reads a parameter file or a preset.

    Args:
        source: Path of a ROS 2 parameter file, or name of a preset; see `preset_names`.
        checks_drive: Whether to refuse a mechanism that its drive cannot move.

    Returns:
        The configuration of a run, with its `mechanism` and `drive`.

    Raises:
        ConfigurationError: There is no such file or preset, or it cannot be used.
    """
    from linkage_ros.settings import configuration  # needs PyYAML

    return configuration.load(source, checks_drive=checks_drive)


@overload
def read_log(path: 'Path | str') -> 'dict[str, dict[str, Array]]': ...


@overload
def read_log(path: 'Path | str', topic: str) -> 'dict[str, Array]': ...


def read_log(path: 'Path | str', topic: str | None = None) -> Any:
    """Reads the joint states and points of a log, or of a bag of another program.

    Args:
        path: An MCAP file, or the folder of a rosbag2 recording.
        topic: Name of one topic, such as `/joint_states`.

    Returns:
        One-dimensional arrays of one length by name; without a topic, a dict of these by topic.
        For joint states: the stamps `t`, s, and for each joint `<joint>.position`, `.velocity` and
        `.effort` in the units of the messages, which in logs of this package are rad or m, rad/s
        or m/s, and N m or N; for `mechanism_state` also `.acceleration`. As in the messages,
        angles are relative to the parent link; a coupler is measured from the crank. For points,
        such as `/points/foot`: `t`, and the coordinates `x`, `y` and `z`, m. Values that a message
        lacks are NaN.

    Raises:
        LogError: The file cannot be read, is incomplete or damaged, or has no such topic.
    """
    from linkage_ros.log import tables  # needs MCAP

    return tables.read_log(path, topic)


__all__ = [
    'CROSSED',
    'OPEN',
    'Barrel',
    'Body',
    'Conditions',
    'ConfigurationError',
    'Coupler',
    'Drawing',
    'DrawnCylinder',
    'DrawnLink',
    'DrawnMass',
    'DrawnSlide',
    'Dyad',
    'DyadSlider',
    'Force',
    'FourBar',
    'Frame',
    'Friction',
    'Gas',
    'Guide',
    'InvertedSliderCrank',
    'LinkLoad',
    'LinkageError',
    'LoadCurve',
    'LogError',
    'Mechanism',
    'MechanismError',
    'MotionError',
    'Pins',
    'Piston',
    'PointMotion',
    'Reach',
    'Reactions',
    'Rocker',
    'Rod',
    'Slider',
    'SliderCrank',
    'Solver',
    'Spring',
    'State',
    'TracedPoint',
    'Travel',
    'UnreachableError',
    'ViewerError',
    'WindPump',
    'load',
    'preset_names',
    'read_log',
    'travel',
]

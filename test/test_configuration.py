# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts parameters to a configuration and back, and tests invalid parameters."""

import math
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from mechanisms import FOLLOWED

from linkage_ros import ConfigurationError
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.motion.drives import DRIVES
from linkage_ros.quantities import MISSING
from linkage_ros.settings.configuration import (
    DEFAULT_PRESET,
    configure,
    from_strings,
    load,
    to_strings,
)
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves

CONFIG = Path(__file__).resolve().parents[1] / 'config'
LEAVES = {leaf.name: leaf for leaf in parameter_leaves(MechanismAndDrive('four_bar'))}
LIMITED = {
    **LEAVES,
    **{x.name: x for x in parameter_leaves(MechanismAndDrive('wind_pump', 'torque'))},
    **{x.name: x for x in parameter_leaves(MechanismAndDrive('four_bar', 'follow'))},
    **{
        x.name: x
        for kind in LOADS
        for x in parameter_leaves(MechanismAndDrive('slider_crank'), {f'loads.{kind}.kind': kind})
    },
}
NUMBERS = [name for name, leaf in LIMITED.items() if leaf.quantity.kind == 'number']
PAIRS = [name for name, leaf in LIMITED.items() if leaf.quantity.kind == 'pair']
REQUIRED = {
    'mechanism': 'four_bar',
    'frame.length': 0.425,
    'crank.length': 0.1,
    'coupler.length': 0.315,
    'rocker.length': 0.5,
    'rpm': 150.0,
}


def clean(name, value):
    return LIMITED[name].quantity.clean(name, value)


# ---------------------------------------------------------------- defaults and presets


@pytest.mark.parametrize('changes', [{}, {'rpm': 60.0, 'rocker.mass': 1.0}])
def test_without_a_mechanism_values_change_the_preset(changes):
    assert configure(changes).parameters() == {**load(DEFAULT_PRESET).parameters(), **changes}
    assert configure({}) == load(DEFAULT_PRESET)


def test_with_a_mechanism_nothing_comes_from_the_preset():
    got = configure(REQUIRED).parameters()
    assert got.items() >= REQUIRED.items()
    assert all(
        value == LEAVES[name].default for name, value in got.items() if name not in REQUIRED
    )
    of_every_node = {'use_sim_time': True, 'start_type_description_service': True}
    configuration = configure({**REQUIRED, **of_every_node})
    assert configuration == configure(REQUIRED)
    assert configuration.drive.start_rpm is None
    assert configuration.mechanism.points == ()


@pytest.mark.parametrize('path', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.stem)
def test_every_preset_loads_by_name_and_by_path(path):
    configuration = load(str(path))
    assert load(path.stem) == configuration
    values = configuration.parameters()
    assert {*values} <= {leaf.name for leaf in parameter_leaves(configuration.only.kind, values)}


# ---------------------------------------------------------------- declarations


@pytest.mark.parametrize('drive', DRIVES)
@pytest.mark.parametrize('mechanism', MECHANISMS)
def test_every_default_is_valid(mechanism, drive):
    found = parameter_leaves(MechanismAndDrive(mechanism, drive))
    assert len({leaf.name for leaf in found}) == len(found)
    for name, quantity, default in found:
        assert default in (MISSING, None) or quantity.clean(name, default) == default


def test_only_speed_motor_and_gravity_may_be_changed_while_running():
    assert [name for name, leaf in LEAVES.items() if leaf.quantity.live] == ['gravity', 'rpm']
    leaves = parameter_leaves(MechanismAndDrive('wind_pump', 'torque'))
    assert [leaf.name for leaf in leaves if leaf.quantity.live] == ['motor.torque']


# ---------------------------------------------------------------- values


@pytest.mark.parametrize('kind', [int, float, np.float64, np.int64, np.float32, Fraction])
def test_numbers_of_any_kind_become_floats(kind):
    got = clean('rpm', kind(60))
    assert type(got) is float
    assert got == 60.0


@pytest.mark.parametrize('name', [*NUMBERS, *PAIRS])
def test_limits_of_ranges_are_inclusive(name):
    quantity = LIMITED[name].quantity
    is_pair = quantity.kind == 'pair'
    for limit, beyond in ((quantity.low, -math.inf), (quantity.high, math.inf)):
        outside = math.nextafter(limit, beyond)
        good, *bad = (
            [(0.0, limit), (0.0, outside), (outside, 0.0)] if is_pair else [limit, outside]
        )
        assert clean(name, good) == good
        for value in bad:
            with pytest.raises(ConfigurationError, match=rf'^{re.escape(name)} = .*: must be '):
                clean(name, value)


@pytest.mark.parametrize('name', ['crank', 'left_crank', 'left_rocker_link'])
def test_frame_id_must_not_be_a_name_of_the_linkage_itself(name):
    values = {**REQUIRED, 'joint_prefix': name.partition('_')[0] + '_' if '_' in name else ''}
    with pytest.raises(ConfigurationError, match=f"^frame_id = '{name}': must not be a joint or "):
        configure({**values, 'frame_id': name})
    other = configure({**values, 'joint_prefix': 'right_', 'frame_id': name})
    assert other.session.frame_id == name


def test_crank_joint_must_not_be_another_joint_of_the_linkage():
    words = "^crank_joint = 'l_coupler': must not be another joint .*, l_coupler, l_rocker; give"
    with pytest.raises(ConfigurationError, match=words):
        configure({**FOLLOWED, 'joint_prefix': 'l_', 'crank_joint': 'l_coupler'})
    for name in ('l_crank', 'coupler'):
        configure({**FOLLOWED, 'joint_prefix': 'l_', 'crank_joint': name})


def test_negative_zero_becomes_zero():
    strings = to_strings(configure({**REQUIRED, 'rpm': -0.0, 'gravity': [-0.0, -0.0]}))
    assert (strings['rpm'], strings['gravity']) == ('0.0', '[0.0, 0.0]')


# ---------------------------------------------------------------- conversion to text


CONFIGURATIONS = [
    {},
    {
        'rpm': 0.1,
        'crank_angle': -1 / 3,
        'gravity': (1e-300, -1e6),
        'points.coupler_point.at': (0.1, 2e5),
    },
    {'log': 'é \n"', 'viewer': 'rerun+http://[::1]:9876/proxy', 'log_overwrite': True},
    {'joint_prefix': 'a_', 'frame_id': 'tool0', 'start_rpm': -2.5, 'assembly': 'crossed'},
    {'drive': 'torque', 'motor.damping': 1e-9, 'command_timeout': 0.1},
    dict(load('wind_pump').parameters()),
]


@pytest.mark.parametrize('values', CONFIGURATIONS)
def test_configuration_survives_conversion_to_strings(values):
    configuration = configure(values)
    strings = to_strings(configuration)
    assert from_strings(strings) == configuration
    assert to_strings(from_strings(strings)) == strings
    assert all(text.isascii() for text in strings.values())
    for name in {'rpm', 'frame.length'} & set(strings):
        changed = math.nextafter(configuration.parameters()[name], math.inf)
        assert to_strings(configure({**values, name: changed}))[name] != strings[name]


@pytest.mark.parametrize('text', ['', '150 rpm', '{', "'open'", 'nan', '1' * 5_000])
def test_strings_that_are_not_json_are_refused(text):
    strings = {**to_strings(configure({})), 'rpm': text}
    with pytest.raises(ConfigurationError, match='configuration is not JSON: ') as caught:
        from_strings(strings)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('name', ['mechanism', 'rpm', 'frame.length', 'rocker.length'])
def test_strings_without_a_required_parameter_are_refused(name):
    """A log is self-contained: none of its values may come from a current preset."""
    strings = to_strings(configure({'rpm': 60.0}))
    del strings[name]
    with pytest.raises(ConfigurationError, match=f'{re.escape(name)} is missing|names no {name}'):
        from_strings(strings)

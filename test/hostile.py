# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Generates hostile parameter files, command lines and live parameters from a seed.

The cases are drawn from a random.Random. The tests and benchmarks/reliability/fuzz.py, which also
runs coverage-guided, use them.
"""

import json
import math

from one_linkage import with_linkage

from linkage_ros.settings.configuration import load
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves
from linkage_ros.settings.presets import preset_names, preset_path

TEXTS = (
    '', ' ', 'a\0b', '\x1b[31m\x1b]0;x\x07', '\u202eevil\u2066', '\ud800', '\U0010ffff', 'é' * 300,
    'x' * 100_000, '../' * 50, '/dev/full', '/dev/null', '-', '~', "'", '"', '%s{0}', 'a\nb\r\n',
    '[' * 1000, '{"a":' * 300, '1e999999999', '1' * 5000, '1/0', '9' * 900, 'NaN', 'Infinity',
)  # fmt: skip
NUMBERS = (
    0.0, -0.0, 5e-324, 1e-300, 1e-9, 0.1, 1.0, -1.0, 1e6, 1e9, 1e12, 1e17, 1e154, 1e300, 1.8e308,
    math.inf, -math.inf, math.nan, 2**31, 2**53 + 1, 2**63 - 1, -(2**63),
)  # fmt: skip
# Possible values in a parameter file.
SCALARS = (
    *map(repr, NUMBERS), '1e300', '.inf', '.nan', '-.inf', '1' * 5000, '0x' + 'f' * 5000, '1e5000',
    '0777', '1_000', '12:30:45', '2001-01-01', '!!set {a, b}', '!!python/object:os.system x',
    '!!binary aGk=', '!!float "1"', '&a [1]', '*a', '{}', '[]', '[0, -9.81]', '[1.0, .nan]', '~',
    'yes', '"\\0"', '"\\ud800"', '"\\U0010FFFF"', '"\\e[31m"', '"\\u202e"', '|\n  x', '? a', '<<',
    'four_bar', 'slider_crank', 'wind_pump', 'torque', 'crossed', "''", '[' * 50, '- ' * 50,
)  # fmt: skip
NAMES = (
    'mechanism', 'drive', 'assembly', 'rpm', 'start_rpm', 'crank_acceleration', 'crank_angle',
    'rate_hz', 'gravity', 'frame.length', 'frame.angle', 'crank.length', 'crank.mass',
    'crank.inertia', 'crank.center', 'coupler.length', 'points.x.at', 'rocker.length',
    'rocker.mass', 'rod.length', 'slider.mass', 'slider.offset', 'loads.a.kind',
    'slider.position', 'slider.velocity', 'motor.torque', 'motor.damping', 'torque_limit',
    'command_timeout', 'lead_time', 'effort_command_topic', 'log', 'viewer', 'log_overwrite',
    'use_sim_time', 'qos_overrides.x', 'crank', 'nonsense', '\u202e', 'ros__parameters',
)  # fmt: skip


# ---------------------------------------------------------------- parameter files


def parameter_file(rng):
    """Generates the bytes of a parameter file."""
    draw = rng.random()
    if draw < 0.05:
        return rng.choice(yaml_bombs())()
    if draw < 0.25:
        return extreme(rng)
    text = preset_path(rng.choice(preset_names())).read_text().encode()
    if draw < 0.5:
        for _ in range(rng.randint(1, 8)):
            text = mutated(rng, text, [scalar.encode('utf-8', 'replace') for scalar in SCALARS])
        return text
    lines = [] if draw < 0.7 else [text.decode()]
    head = rng.choice(('linkage_node:', '/**:', '"/**"', 'other:', '/**:\n  /**:'))
    lines += [head, '  ros__parameters:']
    for _ in range(rng.randint(0, 6)):
        name, value = rng.choice(NAMES), rng.choice(SCALARS)
        if rng.random() < 0.3:
            value = f'[{", ".join(rng.choices(SCALARS, k=rng.randint(1, 4)))}]'
        lines.append(f'    {name}: {value}')
    return '\n'.join(lines).encode('utf-8', 'replace')


def extreme(rng):
    """Generates a preset in which some values are extreme, within their ranges or at any scale."""
    configuration = load(rng.choice(preset_names()))
    values, scale = configuration.parameters(), 10.0 ** rng.randint(-8, 8)
    if rng.random() < 0.5 and values['drive'] == 'speed':
        values |= {'drive': 'torque', 'motor.torque': 1.0}
        configuration = with_linkage(
            configuration, kind=MechanismAndDrive(values['mechanism'], 'torque')
        )
    leaves = {leaf.name: leaf.quantity for leaf in parameter_leaves(configuration.only.kind)}
    values = {name: value for name, value in values.items() if name in leaves}
    for name in values:
        if leaves[name].unit == 'm' and rng.random() < 0.9:
            part = values[name]
            values[name] = part * scale if isinstance(part, float) else [x * scale for x in part]
    for name in rng.sample(sorted(leaves), rng.randint(0, 6)):
        low, high = max(leaves[name].low, -1e300), min(leaves[name].high, 1e300)
        near = rng.choice(
            (0.0, low, high, low * 1e-3, high * 1e-6, high * 10.0 ** -rng.randint(0, 20))
        )
        if leaves[name].kind == 'number' and near:
            values[name] = min(max(near, low), high)
        elif leaves[name].kind == 'pair':
            values[name] = [near, rng.choice((0.0, near, -near))]
    lines = (
        f'    {name}: {json.dumps(value)}' for name, value in values.items() if value is not None
    )
    return '\n'.join(('linkage_node:', '  ros__parameters:', *lines)).encode()


def yaml_bombs():
    """Returns files on which other readers use up all memory, time or stack."""
    own = 'linkage_node:\n  ros__parameters:\n'
    laughs = '\n'.join(
        f'  {b}: &{b} [{f"*{a}, " * 9}]' for a, b in zip('abcdefgh', 'bcdefghi', strict=True)
    )
    return (
        lambda: f'x:\n  a: &a [lol]\n{laughs}\n'.encode(),
        lambda: f'{own}    rpm: [{"1.0," * 60_000}]\n'.encode(),
        lambda: f'{own}    gravity: {"[" * 100_000}\n'.encode(),
        lambda: f'{own}    gravity: {"{a: " * 100_000}\n'.encode(),
        lambda: (own + ''.join(f'{" " * n}a:\n' for n in range(4, 700))).encode(),
        lambda: (own + ''.join(f'    a{n}: 1\n' for n in range(5_000))).encode(),
        lambda: f'{own}    log: "{"x" * 1_000_000}"\n'.encode(),
        lambda: f'{own}    {"k" * 100_000}: 1\n'.encode(),
        lambda: f'{own}    log: "\\ud83d\\0\\e\\u202e"\n'.encode(),
        lambda: f'{own}    rpm: {"9" * 100_000}\n'.encode(),
        lambda: f'{own}    rpm: 1e-{"9" * 100_000}\n'.encode(),
        lambda: (own + '    rpm: 1.0\n').encode('utf-16'),
        lambda: own.encode() + b'    log: \xff\xfe\xed\xa0\x80\n',
        lambda: b'\0' * 5000,
        lambda: b'%TAG ! tag:x,2000:\n---\n' * 1000,
        lambda: b'? ' * 100_000,
        lambda: b'- ' * 100_000,
        lambda: b'a: b: ' * 10_000,
        lambda: b'a: b' + b'[' * 300_000,
        lambda: (
            own + '    {' + ''.join(f'{"n" * 120}{n}: 1, ' for n in range(7000)) + '}'
        ).encode(),
        lambda: f'{own}    {{? {"n" * 500_000}: {{{"a: 1, " * 50_000}}}}}'.encode(),
        lambda: f'{own}    rpm: 0x{"1" * 900_000}'.encode(),
        lambda: b'x' * (1 << 21),
    )


def mutated(rng, data, words):
    """Returns bytes with a change at one position, sometimes to one of some words."""
    at = rng.randrange(len(data) + 1)
    end = min(len(data), at + rng.choice((1, 1, 1, 2, 4, 8, 100)))
    kind = rng.randrange(6)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + data[end:]
    if kind == 2:
        return data[:at] + data[at:end] * rng.choice((2, 3, 100)) + data[end:]
    if kind == 3:
        return data[:at] + rng.randbytes(end - at) + data[end:]
    if kind == 4 and at < len(data):
        return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
    return data[:at] + rng.choice(words) + data[end:]


# ---------------------------------------------------------------- command lines


def replay_options(rng):
    """Generates arguments for `linkage_replay LOG.mcap`, most of them invalid."""
    numbers = [*map(repr, NUMBERS), '1' * 5000, '0x10', '1_0', '', 'x', '\udcff', 'a\nb', '٣']
    words = []
    for _ in range(rng.randint(1, 5)):
        name = rng.choice((
            '--rate', '-r', '--start-offset', '--playback-duration', '-d', '--delay', '--clock',
            '--topics', '--viewer', '--loop', '-l', '--start-paused', '-p', '--no-ros', '--x', '-',
            '--rate=nan', '--play', '--', rng.choice(TEXTS),
        ))  # fmt: skip
        words.append(name)
        if rng.random() < 0.7:
            words.append(rng.choice((*numbers, *TEXTS)))
    return [word.replace('\0', '') for word in words]


# ---------------------------------------------------------------- live parameters


# Types of ParameterValue, numbered from 1, and example values.
TYPES = ('bool', 'integer', 'double', 'string', *(f'{kind}_array' for kind in (
    'byte', 'bool', 'integer', 'double', 'string')))  # fmt: skip


def live_parameters(rng):
    """Generates a request to set parameters: names, types, and values of all fields.

    Few type numbers are invalid; about one in ten requests has the type of the parameter.
    """
    return [_parameter(rng) for _ in range(rng.choice((1, 1, 1, 2, 5)))]


def _parameter(rng):
    if rng.random() < 0.1:
        return rng.choice(('rpm', 'motor.torque')), 3, 'double_value', rng.uniform(-1e6, 1e6)
    whole = [number for number in NUMBERS if isinstance(number, int)]
    texts = [text for text in TEXTS if '\0' not in text and text.isascii()]
    kinds = {
        'bool': lambda: rng.random() < 0.5,
        'integer': lambda: rng.choice((*whole, rng.randint(-1000, 1000))),
        'double': lambda: rng.choice((*map(float, NUMBERS), rng.uniform(-1e6, 1e6))),
        'string': lambda: rng.choice(texts),
        'byte': lambda: bytes([rng.randrange(256)]),
    }
    name = rng.choice(('rpm', 'motor.torque', 'use_sim_time', rng.choice(NAMES[:-2])))
    kind = rng.choice((*TYPES, *['double'] * 9, 'integer'))
    number = TYPES.index(kind) + 1 if rng.random() < 0.95 else rng.randrange(10)
    draw, row = kinds[kind.removesuffix('_array')], kind.endswith('_array')
    count = rng.choice((0, 1, 2, 3, 1000))
    return name, number, f'{kind}_value', [draw() for _ in range(count)] if row else draw()

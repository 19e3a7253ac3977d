# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Generates long, deep and damaged files of every kind that linkage_ros reads, from a seed.

KINDS has a function for each kind, which returns the content of a file from a random.Random, and
SETTINGS the parameter files that name it.
fuzz.py gives the files to the programs that read them.
"""

import struct
from itertools import pairwise
from pathlib import Path

import hostile
import hostile_logs
from mcap.records import Attachment, Metadata, Schema

from linkage_ros.settings.presets import preset_names, preset_path

LEG = (Path(__file__).parents[2] / 'docs/examples/leg.urdf').read_bytes()
COUNTS = 10, 100, 1_000, 10_000, 100_000
MOST = 1 << 24  # bytes of a generated file

STUDY = b"""base: quadrilateral
designs: 4
ranges: {coupler.length: [0.30, 0.34], points.coupler_point.at.0: [0.1, 0.2], rpm: [10.0, 20.0]}
measures: [peak_torque, swing]
goals: {peak_torque: least, swing: most}
"""
LAW = b'time,angle,speed\n0.0,0.0,1.0\n0.5,0.4,0.5\n1.0,0.0,1.0\n'
LOAD = b'crank_angle_deg,value\n0,1.0\n90,2.0\n360,1.0\n'
# Parameter files that name a file of the same folder.
_MACHINE = """/**:
  ros__parameters:
    mechanism: four_bar
    frame: {length: 0.4}
    crank: {length: 0.1}
    coupler: {length: 0.3}
    rocker: {length: 0.35, mass: 1.0}
"""
SETTINGS = {
    'law': _MACHINE + '    drive: motion\n    motion: {file: case}\n',
    'load': _MACHINE + '    rpm: 60.0\n    loads: {a: {kind: curve, link: crank, file: case}}\n',
    'bag': _MACHINE + '    drive: follow\n',
}
SDF = b"""<?xml version="1.0"?>
<sdf version="1.9"><model name="m"><link name="base"/>
<link name="a"><inertial><mass>1</mass></inertial></link>
<link name="b"><pose relative_to="a">0.1 0 0 0 0 0</pose></link>
<link name="c"><pose>0.4 0 0 0 0 0</pose></link>
<frame name="f" attached_to="c"><pose>0 0 0.2 0 0 0</pose></frame>
<joint name="crank" type="revolute"><parent>base</parent><child>a</child>
<axis><xyz>0 1 0</xyz></axis></joint>
<joint name="j" type="revolute"><parent>a</parent><child>b</child>
<axis><xyz>0 1 0</xyz></axis></joint>
<joint name="k" type="revolute"><parent>base</parent><child>c</child>
<axis><xyz>0 1 0</xyz></axis></joint>
<joint name="l" type="revolute"><pose relative_to="f"/><parent>b</parent><child>c</child>
<axis><xyz>0 1 0</xyz></axis></joint></model></sdf>
"""
MJCF = b"""<mujoco><compiler angle="radian"/><default><joint axis="0 1 0"/></default><worldbody>
<body name="a"><joint name="crank"/><geom size="0.01" mass="1"/>
<body name="b" pos="0.1 0 0"><joint name="j"/><geom size="0.01" mass="1"/></body></body>
<body name="c" pos="0.4 0 0"><joint name="k"/><geom size="0.01" mass="1"/></body></worldbody>
<equality><connect body1="b" body2="c" anchor="0.3 0 0.2"/></equality></mujoco>
"""


# ---------------------------------------------------------------- text


def encoded(rng, data):
    """Returns a text as it is, as other systems write it, or damaged."""
    if rng.random() < 0.7:
        return data
    for _ in range(rng.choice((0, 0, 1, 4))):
        data = hostile.mutated(rng, data, (b'\0', b'\r', b'\xff', b'"', b"'", b'\xe2\x80\xa8'))
    change = rng.randrange(6)
    if change == 0:
        return b'\xef\xbb\xbf' + data
    if change == 1:
        return data.decode(errors='replace').encode('utf-16')
    if change == 2:
        return data.replace(b'\n', rng.choice((b'\r', b'\r\n')))
    if change == 3:
        return data[: rng.randrange(len(data) + 1)]
    return data


def _inserted(rng, data, piece, after):
    """Returns a text with a piece behind one of the places that end with some bytes."""
    places = [n + len(after) for n in range(len(data)) if data.startswith(after, n)] or [0]
    at = rng.choice(places)
    return data[:at] + piece + data[at:]


def _nested(rng, begin, end, count, inner=b''):
    """Returns text in nested brackets, some of which do not end."""
    return (
        begin * count
        + inner
        + end * rng.choice((count, count, count, count, 0, count // 2, count + 1))
    )


def yaml_text(rng, base, indent):
    """Inserts something long or deep into YAML, as a line with some indentation."""
    count = rng.choice(COUNTS)
    names = (b'crank.length', b'rpm', b'gravity', b'designs', b'swing', b'k' * rng.choice(COUNTS))
    name = rng.choice((*names, *(text.encode() for text in hostile.NAMES)))
    value = rng.choice((
        lambda: _nested(rng, b'[', b']', count, b'1.0'),
        lambda: _nested(rng, b'{a: ', b'}', count, b'1.0'),
        lambda: _nested(rng, b'- ', b'', count), lambda: _nested(rng, b'? ', b'', count),
        lambda: _nested(rng, b'!!python/tuple [', b']', count),
        lambda: b'9' * count, lambda: b'-' + b'9' * count + b'.' + b'9' * count,
        lambda: b'1e' + b'9' * count, lambda: b'0x' + b'f' * count, lambda: b'1:' * count,
        lambda: b'2001-01-01T00:00:00Z', lambda: b'[2001-01-01, ' + b'2001-01-01, ' * count + b']',
        lambda: b'[' + b'1.0, ' * count + b'1.0]', lambda: b'[' + b'"x", ' * count + b']',
        lambda: b'"' + b'x' * count + b'"', lambda: b'"' + b'\\' * count, lambda: b"'" * count,
        lambda: b'|\n' + (b' ' * 8 + b'x\n') * count, lambda: b'#' * count, lambda: b'\t' * count,
        lambda: b'a: ' * count, lambda: b'a:b ' * count, lambda: b'1,2 ' * count,
        lambda: b'[1,2' * count, lambda: b'"a' * count, lambda: b'*a ' * count,
        lambda: b'&a ' * count, lambda: b'! ' * count, lambda: b'<' * count,
    ))()  # fmt: skip
    lines = rng.choice((
        lambda: [name + b': ' + value],
        lambda: [b'k%d: 1' % n for n in range(count)],
        lambda: [b'rpm: 1.0'] * count,
        lambda: [b' ' * min(n, 2_000) + b'a:' for n in range(min(count, 4_000))],
        lambda: [b'a: &a {b: 1}', *(b'c%d: {<<: *a}' % n for n in range(count))],
        lambda: [b'<<: [' + b'*a, ' * count + b']'],
        lambda: [b'a0: &a0 [x, x]', *(
            b'a%d: &a%d [*a%d, *a%d]' % (n, n, n - 1, n - 1) for n in range(1, min(count, 1_000))
        )],
        lambda: [b'k%d: &a%d x' % (n, n) for n in range(count)],
        lambda: [b''] * count, lambda: [b'# comment'] * count,
        lambda: [b'"k%d": "%s"' % (n, b'v' * 20) for n in range(count)],
        lambda: [b'- 1'] * count,
    ) if rng.random() < 0.5 else (lambda: [name + b': ' + value],))()  # fmt: skip
    piece = b''.join(b' ' * indent + line + b'\n' for line in lines)
    draw = rng.random()
    if draw < 0.1:
        return value
    if draw < 0.2:
        return rng.choice((b'---\n', b'%YAML 1.1\n---\n', b'/**:\n', b'...\n', base)) * count
    if draw < 0.3:
        return base + piece
    return _inserted(rng, base, piece, b'\n')


def parameter_file(rng):
    """Generates a parameter file."""
    base = preset_path(rng.choice(preset_names())).read_bytes()
    return encoded(rng, yaml_text(rng, base, rng.choice((0, 4, 4, 4, 6)))[:MOST])


def study_file(rng):
    """Generates a study."""
    base = STUDY if rng.random() < 0.8 else STUDY.replace(b'4\n', b'%d\n' % rng.choice(COUNTS), 1)
    return encoded(rng, yaml_text(rng, base, rng.choice((0, 0, 0, 2)))[:MOST])


def csv_file(rng, base):
    """Generates a CSV file with something long in it."""
    count = rng.choice((*COUNTS, 10_000_000))
    head, row = base.splitlines()[0], rng.choice(base.splitlines()[1:])
    columns, few = head.count(b','), min(count, 1_000_000)
    lines = rng.choice((
        lambda: head + b'\n' + b''.join(
            b','.join([b'%.9g' % (360 * n / few), *[b'0'] * columns]) + b'\n'
            for n in range(few + 1)
        ),
        lambda: head + b'\n' + (row + b'\n') * few,
        lambda: head + b'\n' + b'0\n' * count,
        lambda: head + b'\n' * count, lambda: head + b'\r' * count, lambda: b',' * count,
        lambda: b'\n' * count + base, lambda: head * few + b'\n' + row,
        lambda: base + row.replace(b'0', b'0' * count), lambda: base + b'0,' * count,
        lambda: base + b'"' * count, lambda: base + b'""0' * count, lambda: base + b'\0' * count,
        lambda: base + b'1' + b'0' * count + b',0\n', lambda: base + b'1e' + b'9' * count,
        lambda: base + b'x' * count, lambda: base + b' ' * count + row,
        lambda: b'"' + head + b'"' * count, lambda: base + b'# ' * count, lambda: base * count,
        lambda: base + b'\xd9\xa3' * count, lambda: base + b'nan,nan,nan\n' * count,
        lambda: base + b'2001-01-01,1\n' * count, lambda: base,
    ))()[:MOST]  # fmt: skip
    return encoded(rng, lines)


# ---------------------------------------------------------------- robot models


def _tree(kind, count, *, chain):
    """Returns links and joints of a chain, or of a star."""
    parents = [b'l%d' % (n - 1 if chain else 0) for n in range(1, count)]
    if kind == 'URDF':
        links = b''.join(b'<link name="l%d"/>' % n for n in range(count))
        joint = (
            b'<joint name="j%d" type="continuous"><parent link="%s"/><child link="l%d"/></joint>'
        )
    else:
        pose = b'<link name="l%d"><pose relative_to="l%d">1 0 0 0 0 0</pose></link>'
        links = b'<link name="l0"/>' + b''.join(
            pose % (n, n - 1 if chain else 0) for n in range(1, count)
        )
        joint = (
            b'<joint name="j%d" type="revolute"><parent>%s</parent><child>l%d</child>'
            b'<axis><xyz>0 1 0</xyz></axis></joint>'
        )
    return links + b''.join(joint % (n, parent, n) for n, parent in enumerate(parents, 1))


def robot_file(rng, kind):
    """Generates a robot model with something long or deep in it."""
    base = {'URDF': LEG, 'SDF': SDF, 'MJCF': MJCF}[kind]
    count = rng.choice(COUNTS)
    few = min(count, 10_000)
    words = 'a link body model default joint inertial geom frame worldbody mujoco include x:y'
    word = rng.choice(words.encode().split())
    name = rng.choice((b'', b' name="x"', b' file="case"', b' class="x"', b' pos="nan"'))
    piece = rng.choice((
        lambda: _nested(rng, b'<%s%s>' % (word, name), b'</%s>' % word, count),
        lambda: b'<%s%s/>' % (word, name) * count,
        lambda: b''.join(b'<%s name="n%d"/>' % (word, n) for n in range(count)),
        lambda: b'<body><joint/><geom size="1"/>' * count + b'</body>' * count,
        lambda: b''.join(b'<body name="n%d">' % n for n in range(count)) + b'</body>' * count,
        lambda: b'<default class="d%d">' % rng.randrange(9) * count + b'</default>' * count,
        lambda: b'<model name="m"><link name="l"/>' * count + b'</model>' * count,
        lambda: _tree(kind, few, chain=True), lambda: _tree(kind, few, chain=False),
        lambda: b'<link name="%s"/>' % (b'x' * count),
        lambda: b'<link ' + b''.join(b'a%d="" ' % n for n in range(count)) + b'/>',
        lambda: b'<origin xyz="%s"/>' % (b'1 ' * count),
        lambda: b'<mass value="%s"/>' % (b'9' * count),
        lambda: b'<pose>%s</pose>' % (b'0 ' * count),
        lambda: b'<!--%s-->' % (b'x' * count), lambda: b'<!--' * count, lambda: b'-->' * count,
        lambda: b'<![CDATA[' + b'<' * count + b']]>', lambda: b'<![CDATA[' * count,
        lambda: b'<?x ' * count, lambda: b'&lol;' * count, lambda: b'&#x10ffff;' * count,
        lambda: b'<' * count, lambda: b'>' * count, lambda: b'<a b="' * count,
        lambda: b''.join(
            b'<frame name="f%d" attached_to="f%d"/>' % (n, n + 1) for n in range(count)
        ),
        lambda: b'<include file="case"/>', lambda: b'<include file="/dev/zero"/>',
        lambda: b'<include><uri>case</uri></include>',
        lambda: b'<replicate count="%d" offset="1 0 0"><body><geom size="1"/></body></replicate>'
        % count,
        lambda: b'<replicate count="9">' * rng.randint(1, 9) + b'<geom size="1"/>',
        lambda: b'<composite type="cable" count="%d 1 1"/>' % count,
        lambda: b'<frame><attach model="x"/></frame>',
        lambda: b'<size nconmax="%d" memory="%dG"/>' % (count, count),
        lambda: b'<asset><mesh file="/dev/zero"/></asset>',
        lambda: b'<asset><hfield name="h" nrow="%d" ncol="%d" size="1 1 1 1"/></asset>'
        % (count, count),
        lambda: b'<asset><texture name="t" type="2d" builtin="flat" width="%d" height="%d"/>'
        % (count, count),
        lambda: b'<equality>' + b'<weld body1="b" body2="c"/>' * few + b'</equality>',
        lambda: b'<option gravity="nan 0 0"/>', lambda: b' ' * count, lambda: b'\n' * count,
    ))()  # fmt: skip
    draw = rng.random()
    if draw < 0.1:
        letters = b'abcdefghij'
        entities = b''.join(
            b'<!ENTITY %c "%s">' % (two, b'&%c;' % one * 10) for one, two in pairwise(letters)
        )
        head = b'<!DOCTYPE x [<!ENTITY a "%s">%s]>' % (b'x' * min(count, 1_000), entities)
        base = head + _inserted(rng, base[base.index(b'<') :], b'&%c;' % rng.choice(letters), b'>')
    elif draw < 0.15:
        return piece
    else:
        base = _inserted(rng, base, piece, b'>')
    return encoded(rng, base[:MOST])


# ---------------------------------------------------------------- logs and bags


def log_file(rng, logs):
    """Generates a damaged, forged or long log."""
    if rng.random() < 0.6:
        return hostile_logs.log_file(rng, logs)
    count = rng.choice(COUNTS)
    empty = hostile_logs.tight(b'')
    piece = rng.choice((
        empty, hostile_logs.chunk(b'', b'', 0), hostile_logs.chunk(b'lz4', b'', 0),
        hostile_logs.packed(Metadata('x', {})), hostile_logs.packed(Schema(7, b'', '', 'x')),
        hostile_logs.packed(Attachment(0, 0, 'x', '', b'')),
        hostile_logs.record_bytes(7, struct.pack('<HI', 0, 0)), empty[:-1], empty + b'\0',
        b'\0', b'\x06', rng.choice(logs),
    ))  # fmt: skip
    pieces = piece * min(count, MOST // len(piece))
    data = hostile_logs.whole(pieces) if rng.random() < 0.5 else rng.choice(logs)[:-100] + pieces
    for _ in range(rng.choice((0, 0, 1, 3))):
        data = hostile.mutated(rng, data, [*hostile_logs.WORDS, hostile_logs.MAGIC])
    return data


KINDS = {
    'parameters': lambda rng, _: parameter_file(rng),
    'study': lambda rng, _: study_file(rng),
    'law': lambda rng, _: csv_file(rng, LAW),
    'load': lambda rng, _: csv_file(rng, LOAD),
    'URDF': lambda rng, _: robot_file(rng, 'URDF'),
    'SDF': lambda rng, _: robot_file(rng, 'SDF'),
    'MJCF': lambda rng, _: robot_file(rng, 'MJCF'),
    'log': log_file,
    'bag': log_file,
}

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads MJCF as MuJoCo compiles it."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from linkage_lab.robots.model import (
    BALL,
    FIXED,
    IDENTITY,
    PRISMATIC,
    REVOLUTE,
    Closure,
    Inertial,
    Joint,
    Robot,
    Transform,
    from_quaternion,
)
from linkage_ros import ConfigurationError
from linkage_ros.internals import read_xml
from linkage_ros.quantities import shown

_KINDS = {0: 'free', 1: BALL, 2: PRISMATIC, 3: REVOLUTE}  # by mjtJoint
_CONNECT, _WELD = 0, 1  # mjtEq
# MuJoCo's compiler takes quadratic time.
_MOST = {'bodies': 1000, 'elements': 5_000}
_FOLDERS = 'assetdir', 'meshdir', 'texturedir'
_NOT_FINITE = re.compile(r'(?i)(?<!\S)[-+]?(nan|inf|infinity)(?!\S)')
_LEFT_OUT = 'armature', 'damping', 'frictionloss'


def read_mjcf(path: Path) -> Robot:
    """Reads bodies, joints, sites as links without mass, and connect and weld constraints.

    Args:
        path: Path of the file.

    Returns:
        The robot, whose root is the world.

    Raises:
        ConfigurationError: MuJoCo cannot compile the file, it is too large, or two parts have one
            name.
    """
    _require_limits(path)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise ConfigurationError(f'MuJoCo: {" ".join(str(error).split())}') from error
    return _Reader(model).robot()


def _require_limits(path: Path) -> None:
    """Requires regular files, finite numbers, and counts that MuJoCo compiles in seconds.

    Raises:
        ConfigurationError: A file cannot be read, a number is not finite, or there are too many
            bodies or elements.
    """
    waiting, seen, folders = [path], {path}, {path.parent}
    counts = Counter[str]()
    while waiting:
        for element, times in _weighted(read_xml(waiting.pop())):
            counts[element.tag] += times
            _require_finite(element)
            if element.tag == 'compiler':
                folders |= {path.parent / element.get(name, '') for name in _FOLDERS}
            name = element.get('file', '')
            for file in (folder / name for folder in sorted(folders)):
                if name and file.exists() and not file.is_file():
                    raise ConfigurationError(f'{file} is not a regular file')
            included = path.parent / name
            if element.tag == 'include' and included not in seen and included.is_file():
                seen.add(included)
                waiting.append(included)
    for name, most in _MOST.items():
        number = counts['body'] if name == 'bodies' else counts.total()
        if number > most:
            raise ConfigurationError(f'the model has {number} {name}: must be at most {most}')


def _require_finite(element: ET.Element) -> None:
    """Requires finite numbers, which MuJoCo does not.

    Raises:
        ConfigurationError: A number is not finite.
    """
    for name, text in element.items():
        if name not in {'name', 'class'} and _NOT_FINITE.search(text):
            raise ConfigurationError(f'<{element.tag}> {name} = {shown(text)}: must be finite')


def _weighted(root: ET.Element) -> Iterator[tuple[ET.Element, int]]:
    """Yields each element of a file, and how often <replicate> and others repeat it."""
    waiting = [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        for number in element.get('count', '').split():
            times *= int(number) if re.fullmatch('[0-9]{1,9}', number) else 1
        yield element, times
        waiting += [(child, times) for child in element]


class _Reader:
    """Collects links and joints of a compiled model, in the order of its bodies."""

    def __init__(self, model: Any) -> None:
        self.model = model
        self.bodies = [
            model.body(i).name or (f'body {i}' if i else 'world') for i in range(model.nbody)
        ]
        self.sites = [model.site(i).name or f'site {i}' for i in range(model.nsite)]
        self.joints: list[Joint] = []
        self.links: dict[str, Inertial | None] = {}
        self.doubts: dict[str, str] = {}

    def robot(self) -> Robot:
        model = self.model
        for name in (*self.bodies, *self.sites):
            if name in self.links:
                raise ConfigurationError(
                    f'two bodies or sites are named {shown(name)}: rename one'
                )
            self.links[name] = None
        for number in range(model.nbody):
            self._take_body(number)
        for site, name in zip(map(model.site, range(model.nsite)), self.sites, strict=True):
            at = Transform(from_quaternion(*site.quat), site.pos)
            self.joints.append(Joint('', FIXED, self.bodies[int(site.bodyid[0])], name, at))
        closures, others = list[Closure](), list[str]()
        for number in range(model.neq):
            self._take_equality(number, closures, others)
        return Robot(
            self.links, self.joints, closures, model.opt.gravity.copy(), {}, others, self.doubts
        )

    def _take_body(self, number: int) -> None:
        """Reads a body with its joints; two joints have a link without mass between them."""
        body, name = self.model.body(number), self.bodies[number]
        if number:
            first = int(body.jntadr[0])
            joints = [self.model.joint(first + i) for i in range(int(body.jntnum[0]))]
            parent = self.bodies[int(body.parentid[0])]
            pose = Transform(from_quaternion(*body.quat), body.pos)
            if not joints:
                self.joints.append(Joint('', FIXED, parent, name, pose))
            for index, joint in enumerate(joints):
                is_last = index == len(joints) - 1
                child = name if is_last else f'{name}, before {joints[index + 1].name}'
                self._take_joint(joint, parent, child, pose)
                self.links.setdefault(child, None)
                parent, pose = child, IDENTITY
        if body.mass[0]:
            turn = from_quaternion(*body.iquat)
            inertia = turn @ np.diag(body.inertia) @ turn.T
            self.links[name] = Inertial(float(body.mass[0]), body.ipos.copy(), inertia)
        if share := float(self.model.body_gravcomp[number]):
            self.doubts[name] = f'gravcomp = {share:g}: left out'

    def _take_joint(self, joint: Any, parent: str, child: str, pose: Transform) -> None:
        kind = _KINDS[int(joint.type[0])]
        at = Transform(np.eye(3), joint.pos.copy())
        made = Joint(
            joint.name or f'{child}_joint', kind, parent, child, pose.then(at), at,
            joint.axis.copy(), left_out=self._left_out(joint),
        )  # fmt: skip
        if kind in {PRISMATIC, REVOLUTE}:  # poses of the file are those at qpos0
            (start,) = self.model.qpos0[joint.qposadr]
            made = made._replace(in_parent=made.in_parent.then(made.motion(-float(start))))
        self.joints.append(made)

    def _left_out(self, joint: Any) -> str:
        dof = int(joint.dofadr[0])
        values = {name: getattr(self.model, f'dof_{name}')[dof] for name in _LEFT_OUT}
        values['stiffness'] = self.model.jnt_stiffness[joint.id]
        given = {name: float(np.max(value)) for name, value in values.items()}
        return ', '.join(f'{name} = {value:g}' for name, value in given.items() if value)

    def _take_equality(self, number: int, closures: list[Closure], others: list[str]) -> None:
        """Reads a constraint: a connect as a closure, a weld as a fixed joint."""
        model, equality = self.model, self.model.equality(number)
        kind = mujoco.mjtEq(int(equality.type[0])).name.removeprefix('mjEQ_').lower()
        name = f'{kind} {shown(equality.name or number)}'
        if not model.eq_active0[number]:
            others.append(f'{name} is not active')
            return
        if int(equality.type[0]) not in {_CONNECT, _WELD}:
            others.append(f'{name} is not a closure')
            return
        is_site = model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE
        known = self.sites if is_site else self.bodies
        first, second = (known[int(i[0])] for i in (equality.obj1id, equality.obj2id))
        points, turn = (np.zeros(3), np.zeros(3)), np.eye(3)
        if not is_site:
            near, far, quaternion = np.split(equality.data[:10].copy(), (3, 6))
            points = near, far
            if int(equality.type[0]) == _WELD:  # MuJoCo stores the point of the second body first
                points, turn = (far, near), from_quaternion(*quaternion)
        if int(equality.type[0]) == _CONNECT:
            closures.append(Closure(name, (first, second), points))
            return
        pose, inside = Transform(turn, points[0]), Transform(np.eye(3), points[1])
        self.joints.append(Joint('', FIXED, first, second, pose, inside))

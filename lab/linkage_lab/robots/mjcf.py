# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads MJCF as MuJoCo compiles it."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
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
    RobotModel,
    Transform,
    from_quaternion,
)
from linkage_ros import ConfigurationError
from linkage_ros.internals import LARGEST, read_xml
from linkage_ros.quantities import shown

_KINDS = {0: 'free', 1: BALL, 2: PRISMATIC, 3: REVOLUTE}  # by mjtJoint
_AT_JOINT = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
_END = ': left out'
# MuJoCo's compiler takes quadratic time.
_MOST = {
    'bodies': 1000, 'elements': 5000, 'meshes': 100, 'points of height fields': 10_000_000,
    'bytes of meshes that give masses': LARGEST,
}  # fmt: skip
_MOST_USER = 1000  # numbers that a user adds to an element; each other one gets as many
_ERRORS = ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError
_USER = [name for name in dir(mujoco.MjSpec) if name.startswith('nuser_')]
_FOLDERS = 'assetdir', 'meshdir', 'texturedir'
_COUNT = re.compile(r'\s*\+?[0-9]{1,9}\s*')
_NOT_FINITE = re.compile(r'(?i)(?<!\S)[-+]?(nan|inf|infinity)(?!\S)')
_FLUID = 'density', 'viscosity'
_LEFT_OUT = 'armature', 'damping', 'dampingpoly', 'frictionloss', 'stiffness', 'stiffnesspoly'


def read_mjcf(path: Path) -> RobotModel:
    """Reads bodies, joints, sites as links without mass, and connect and weld constraints.

    Returns:
        The robot, whose root is the world.

    Raises:
        ConfigurationError: MuJoCo cannot compile the file, it is too large, or two parts have one
            name.
    """
    folders = _require_limits(path)
    try:
        model = _compiled(mujoco.MjSpec.from_file(str(path)), folders)
    except ConfigurationError:  # its message is already clear
        raise
    except _ERRORS as error:
        raise ConfigurationError(f'MuJoCo: {" ".join(str(error).split())}') from error
    return _Reader(model).robot()


def _compiled(spec: Any, folders: Iterable[Path]) -> Any:
    """Compiles a model without parts that may be large and do not change its mechanics.

    Raises:
        ConfigurationError: It has too many bodies, or meshes that are too many or too large.
    """
    for part in (*spec.keys, *spec.sensors, *spec.tuples, *spec.pairs):
        spec.delete(part)
    _leave_out_meshes(spec)
    files = {folder / mesh.file for mesh in spec.meshes if mesh.file for folder in folders}
    size = sum(file.stat().st_size for file in files if file.is_file())
    counts = {'bodies': len(spec.bodies), 'meshes': len(spec.meshes)}
    _require_counts(Counter({**counts, 'bytes of meshes that give masses': size}))
    spec.nkey = spec.nuserdata = 0
    for name in ('memory', 'njmax', 'nconmax', *_USER):
        setattr(spec, name, -1)
    spec.compiler.discardvisual = False
    for geom in spec.geoms:  # without contacts, no convex hulls of meshes
        geom.contype = geom.conaffinity = 0
    spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE
    for actuator in spec.actuators:
        actuator.nsample = 0
    for texture in spec.textures:
        texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
        texture.width = texture.height = 1
    for field in spec.hfields:
        field.file, field.nrow, field.ncol, field.userdata = '', 2, 2, np.zeros(4)
    return spec.compile()


def _leave_out_meshes(spec: Any) -> None:
    """Removes the meshes of bodies whose masses are given, which may take gigabytes."""
    if spec.compiler.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        explicit = [body for body in spec.bodies if body.explicitinertial]
        for geom in [geom for body in explicit for geom in body.geoms if geom.meshname]:
            spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in spec.meshes:
        if (mesh.name or Path(mesh.file).stem) not in used:
            spec.delete(mesh)


def _require_limits(path: Path) -> set[Path]:
    """Requires regular files, finite numbers, and counts that MuJoCo compiles in seconds.

    Returns:
        The folders in which MuJoCo may search for files.

    Raises:
        ConfigurationError: A file cannot be read, a number is not finite, or there are too many
            bodies or elements.
    """
    waiting, seen, folders = [path], {path}, {path.parent}
    counts = Counter[str]()
    while waiting:
        for element, times in _weighted(read_xml(waiting.pop())):
            counts['bodies'] += times if element.tag == 'body' else 0
            counts['elements'] += times
            counts['points of height fields'] += times * _points(element)
            _require_counts(counts)
            _require_numbers(element)
            if element.tag == 'compiler':
                folders |= {path.parent / element.get(name, '') for name in _FOLDERS}
            for file in _files(element, folders):
                if element.tag in {'include', 'model'} and file not in seen:
                    seen.add(file)
                    waiting.append(file)
    return folders


def _files(element: ET.Element, folders: Iterable[Path]) -> list[Path]:
    """Returns the existing files that an element may name, one in each folder at most.

    Raises:
        ConfigurationError: One is not a regular file.
    """
    name = element.get('file', '')
    files = [folder / name for folder in sorted(folders)] if name else []
    existing = [file for file in files if file.exists()]
    for file in existing:
        if not file.is_file():
            raise ConfigurationError(f'{file} is not a regular file')
    return existing


def _require_counts(counts: Mapping[str, int]) -> None:
    """Requires counts that MuJoCo compiles in seconds.

    Raises:
        ConfigurationError: There are too many bodies, elements or numbers.
    """
    for name, most in _MOST.items():
        if counts[name] > most:
            raise ConfigurationError(
                f'the model has {counts[name]} or more {name}: must be at most {most}'
            )


def _points(element: ET.Element) -> int:
    """Returns the number of points of a height field."""
    sides = [element.get(name, '') for name in ('nrow', 'ncol')]
    return math.prod(map(int, sides)) if all(map(_COUNT.fullmatch, sides)) else 0


def _require_numbers(element: ET.Element) -> None:
    """Requires finite numbers, which MuJoCo does not, and few that a user adds.

    Raises:
        ConfigurationError: A number is not finite, or a user adds too many.
    """
    if (number := len(element.get('user', '').split())) > _MOST_USER:
        raise ConfigurationError(
            f'<{element.tag}> user has {number} numbers: must be at most {_MOST_USER}'
        )
    for name, text in element.items():
        if name not in {'name', 'class'} and _NOT_FINITE.search(text):
            raise ConfigurationError(f'<{element.tag}> {name} = {shown(text)}: must be finite')


def _weighted(root: ET.Element) -> Iterator[tuple[ET.Element, int]]:
    """Yields each element of a file, and how often <replicate> and others repeat it."""
    waiting = [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        for number in element.get('count', '').split():
            times *= int(number) if _COUNT.fullmatch(number) else 1
        yield element, times
        waiting += [(child, times) for child in element]


def _frames(kind: str, data: Any) -> tuple[Transform, Transform]:
    """Returns the frames in two bodies that a connect or weld makes coincide."""
    if kind == 'connect':
        return Transform(np.eye(3), data[:3]), Transform(np.eye(3), data[3:6])
    # MuJoCo stores the point of the second body first.
    return Transform(from_quaternion(*data[6:10]), data[3:6]), Transform(np.eye(3), data[:3])


class _Reader:
    """Collects links and joints of a compiled model, in the order of its bodies."""

    def __init__(self, model: Any) -> None:
        self.model = model
        self.bodies = [
            model.body(i).name or (f'body {i}' if i else 'world') for i in range(model.nbody)
        ]
        self.sites = [model.site(i).name or f'site {i}' for i in range(model.nsite)]
        self.joints: list[Joint] = []
        self.movable: list[int] = []  # number in `joints` of each joint of the model
        self.pulled: dict[int, list[str]] = {}  # what acts on a tendon, by its number
        self.links: dict[str, Inertial | None] = {}
        self.doubts: dict[str, str] = {}

    def robot(self) -> RobotModel:
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
        for number in range(model.nu):
            self._take_actuator(number)
        for number in range(model.ntendon):
            self._take_tendon(number)
        gravity = np.zeros(3) if self._is_disabled('GRAVITY') else model.opt.gravity.copy()
        return RobotModel(
            self.links, self.joints, closures, gravity, {}, others, self.doubts, self._fluid()
        )

    def _is_disabled(self, name: str) -> bool:
        flag = getattr(mujoco.mjtDisableBit, f'mjDSBL_{name}')
        return bool(self.model.opt.disableflags & flag)

    def _fluid(self) -> list[str]:
        """Describes the fluid that surrounds the robot."""
        option = self.model.opt
        properties = [
            f'{name} = {getattr(option, name):g}' for name in _FLUID if getattr(option, name)
        ]
        if not properties:
            return []
        if any(option.wind):
            properties.append(f'wind = {" ".join(f"{x:g}" for x in option.wind)}')
        return [f'{", ".join(properties)}: left out']

    def _take_actuator(self, number: int) -> None:
        """Notes the inertia and damping of an actuator at its joint or tendon."""
        properties = ', '.join(self._nonzero('actuator', number))
        if not properties:
            return
        text = f'actuator {shown(self.model.actuator(number).name or number)} ({properties})'
        at = int(self.model.actuator_trnid[number][0])
        if self.model.actuator_trntype[number] in _AT_JOINT:
            self._leave_out(at, text)
        elif self.model.actuator_trntype[number] == mujoco.mjtTrn.mjTRN_TENDON:
            self.pulled.setdefault(at, []).append(text)

    def _take_tendon(self, number: int) -> None:
        """Notes the forces of a tendon at what it moves: joints, or the bodies of its sites."""
        model = self.model
        properties = ', '.join([*self._nonzero('tendon', number), *self.pulled.get(number, ())])
        if not properties:
            return
        text = f'tendon {shown(model.tendon(number).name or number)} ({properties})'
        start = model.tendon_adr[number]
        path = range(start, start + model.tendon_num[number])
        objects = dict.fromkeys((model.wrap_type[i], model.wrap_objid[i]) for i in path)
        for kind, at in objects:  # each once
            if kind == mujoco.mjtWrap.mjWRAP_JOINT:
                self._leave_out(at, text)
            elif kind == mujoco.mjtWrap.mjWRAP_SITE:
                site = self.sites[at]
                before = self.doubts.get(site, '').removesuffix(_END)
                self.doubts[site] = ', '.join(filter(None, [before, text])) + _END

    def _leave_out(self, joint: int, text: str) -> None:
        """Notes what is left out at a joint."""
        index = self.movable[joint]
        made = self.joints[index]
        left_out = ', '.join(filter(None, [made.left_out, text]))
        self.joints[index] = made._replace(left_out=left_out)

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
            for i, joint in enumerate(joints, 1):
                child = name if i == len(joints) else f'{name}, before {joints[i].name}'
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
        left_out = *self._nonzero('dof', int(joint.dofadr[0])), *self._nonzero('jnt', joint.id)
        made = Joint(
            joint.name or f'{child}_joint', kind, parent, child, pose.then(at), at,
            joint.axis.copy(), left_out=', '.join(left_out),
        )  # fmt: skip
        if kind in {PRISMATIC, REVOLUTE}:  # poses of the file are those at qpos0
            (start,) = self.model.qpos0[joint.qposadr]
            made = made._replace(in_parent=made.in_parent.then(made.motion(-float(start))))
        self.movable.append(len(self.joints))
        self.joints.append(made)

    def _nonzero(self, kind: str, number: int) -> Iterator[str]:
        """Yields what is left out of a part, such as its damping, if it is not 0."""
        for name in _LEFT_OUT:
            values = getattr(self.model, f'{kind}_{name}', None)
            if values is not None and np.any(values[number]):
                numbers = ' '.join(f'{x:g}' for x in np.atleast_1d(values[number]))
                yield f'{name} = {numbers}'

    def _take_equality(self, number: int, closures: list[Closure], others: list[str]) -> None:
        """Reads a constraint: a connect as a closure, a weld as a fixed joint."""
        model, equality = self.model, self.model.equality(number)
        kind = mujoco.mjtEq(int(equality.type[0])).name.removeprefix('mjEQ_').lower()
        name = f'{kind} {shown(equality.name or number)}'
        if not model.eq_active0[number]:
            others.append(f'{name} is not active')
            return
        if self._is_disabled('EQUALITY') or self._is_disabled('CONSTRAINT'):
            others.append(f'{name} is disabled by <flag>')
            return
        objects = [int(equality.obj1id[0]), int(equality.obj2id[0])]
        if kind not in {'connect', 'weld'}:
            others.append(f'{name} is not a closure')
            self._leave_out_equality(kind, objects, f'constraint {name}')
            return
        is_of_sites = model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE
        names = self.sites if is_of_sites else self.bodies
        first, second = (names[i] for i in objects)
        in_first, in_second = IDENTITY, IDENTITY  # the frames that coincide; origins of sites
        if not is_of_sites:
            in_first, in_second = _frames(kind, equality.data.copy())
        if kind == 'connect':
            points = in_first.place, in_second.place
            closures.append(Closure(name, (first, second), points))
        else:
            self.joints.append(Joint('', FIXED, first, second, in_first, in_second))

    def _leave_out_equality(self, kind: str, objects: list[int], text: str) -> None:
        """Notes a constraint that is left out at its joints or tendons."""
        for at in objects:
            if at < 0:  # the file gives no second object
                continue
            if kind == 'joint':
                self._leave_out(at, text)
            elif kind == 'tendon':
                self.pulled.setdefault(at, []).append(text)

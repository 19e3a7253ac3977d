# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters that map the linkage to the robot's own joints."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.parts import FRAME_NAME
from linkage_ros.mechanism.structure import Link
from linkage_ros.messages.joints import RobotJoint, own_joints
from linkage_ros.quantities import (
    Checked,
    Leaf,
    build,
    flatten,
    leaves,
    quantity,
    refuse_angles,
    shown,
)

GROUP = 'joints'


@dataclass(frozen=True)
class JointSettings(Checked):
    """The robot's joint of a link; what is None is that of the linkage's own joint."""

    name: str | None = quantity(
        'text', "the robot's name of the joint; '': not published", default=None
    )
    zero: float | None = quantity(
        'number', 'direction relative to the parent, or position, at which the joint is at 0',
        'rad or m', span=(-1e9, 1e9), default=None,
    )  # fmt: skip
    ratio: float | None = quantity(
        'number', 'joint value per rad or m, negative if the joint is reversed; default 1',
        span=(-1e6, 1e6), default=None,
    )  # fmt: skip
    parent: str | None = quantity(
        'text', 'link from which the joint is measured, or frame; default: that of the open tree',
        default=None,
    )  # fmt: skip


def joint_leaves(mechanism: Any, values: Mapping[str, object] | None = None) -> tuple[Leaf, ...]:
    """Returns the parameters of the joints of a kind of mechanism, one for each link with a mass.

    The dyads in the values add joints.
    """
    names = (leaf.name for leaf in leaves(mechanism, values=values))
    masses = [name.removesuffix('.mass') for name in names if name.endswith('.mass')]
    links = [re.sub(r'^(dyads|drawing\.\w+)\.', '', name).replace('.', '_') for name in masses]
    links = [*dict.fromkeys(links)]
    return tuple(leaf for link in links for leaf in leaves(JointSettings, f'{GROUP}.{link}.'))


def build_joints(values: Mapping[str, object]) -> dict[str, JointSettings]:
    """Returns the settings of the given joints, by link; `joint_values` inverts it.

    Raises:
        ConfigurationError: A value is invalid.
    """
    links = dict.fromkeys(x.split('.')[1] for x in values if x.startswith(f'{GROUP}.'))
    return {link: build(JointSettings, values, f'{GROUP}.{link}.') for link in links}


def joint_values(joints: Mapping[str, JointSettings]) -> dict[str, object]:
    """Returns the given values by parameter name."""
    return {
        name: value
        for link, joint in joints.items()
        for name, value in flatten(joint, f'{GROUP}.{link}.').items()
    }


def measured_from(links: Sequence[Link], link: Link, given: JointSettings | None) -> str:
    """Returns the link, or frame, from whose direction the joint of a link is measured.

    The position of a sliding link is measured from no direction.
    """
    if link.slides:
        return FRAME_NAME
    of_tree = FRAME_NAME if link.parent is None else links[link.parent].name
    return (given and given.parent) or of_tree


def _check(given: JointSettings, link: Link, parents: Sequence[str]) -> None:
    """Checks the settings of the joint of a link, which may be measured from `parents`.

    Raises:
        ConfigurationError: The parent is not valid, the zero of a sliding link is in degrees, or
            the ratio is 0.
    """
    group = f'{GROUP}.{link.name}'
    if given.parent is not None and given.parent not in parents:
        raise ConfigurationError(
            f'{group}.parent = {shown(given.parent)}: must be {" or ".join(parents)}'
        )
    if link.slides:
        refuse_angles(f'{group}.zero', given.zero, f'the {link.name}')
    if given.ratio == 0:
        raise ConfigurationError(f'{group}.ratio = 0: must be positive or negative')


def robot_joints(
    links: Sequence[Link],
    settings: Mapping[str, JointSettings],
    joint_prefix: str,
    *,
    driven: int = 0,
    is_measured: bool = False,
) -> tuple[RobotJoint, ...]:
    """Returns the joint of each link in messages.

    Args:
        links: The links of the mechanism.
        settings: The given joints, by link.
        joint_prefix: Prefix of names that are not given.
        driven: Index of the driven link.
        is_measured: Whether that link is measured, so that messages repeat its value.

    Returns:
        The joints, in the order of the links.

    Raises:
        ConfigurationError: A ratio is 0, a parent is not valid, the zero of a sliding link is in
            degrees, or two joints have one name.
    """
    axes: dict[str, tuple[int | None, float | None]] = {FRAME_NAME: (None, None)}
    axes |= {link.name: axes_of(links, i) for i, link in enumerate(links)}
    joints = list(own_joints(links, joint_prefix))
    joints[driven] = joints[driven]._replace(is_measured=is_measured)
    for i, link in enumerate(links):
        given = settings.get(link.name, JointSettings())
        parents = [name for name in axes if name != link.name]
        if i == driven or link.slides:
            parents = [FRAME_NAME if link.parent is None else links[link.parent].name]
        _check(given, link, parents)
        if i == driven and given.name == '':
            raise ConfigurationError(
                f"{GROUP}.{link.name}.name = '': must be a name, because the others follow it"
            )
        axis = axes[measured_from(links, link, given)]
        joints[i] = _mapped(joints[i], given, axis)
    _require_tree(joints, links)
    names = [joint.name for joint in joints if joint.name]
    if repeated := next((name for name in names if names.count(name) > 1), ''):
        raise ConfigurationError(
            f'two joints are named {shown(repeated)}: give each of {GROUP} a name of its own'
        )
    return tuple(joints)


def _mapped(
    joint: RobotJoint, given: JointSettings, axis: tuple[int | None, float | None]
) -> RobotJoint:
    """Returns a joint with its settings, measured from an axis; see `axes_of`."""
    parent, guide = axis
    return joint._replace(
        name=joint.name if given.name is None else given.name,
        parent=parent,
        guide=guide,
        zero=float(given.zero or 0.0),
        ratio=1.0 if given.ratio is None else given.ratio,
        is_mapped=any(x is not None for x in (given.zero, given.ratio, given.parent)),
    )


def _require_tree(joints: Sequence[RobotJoint], links: Sequence[Link]) -> None:
    """Rejects parents that form a circle.

    Raises:
        ConfigurationError: They do.
    """
    for joint, link in zip(joints, links, strict=True):
        above = joint.parent
        for _ in links:  # no way to the frame is longer
            above = None if above is None else joints[above].parent
        if above is not None:
            raise ConfigurationError(
                f'{GROUP}.{link.name}.parent: the parents form a circle; '
                f'measure one from {FRAME_NAME}'
            )

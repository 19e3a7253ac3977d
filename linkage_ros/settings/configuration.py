# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Creates a validated configuration from the parameters of a node, a file or a log."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import Any

from linkage_ros.errors import (
    MOST_LISTED,
    ConfigurationError,
    Mistakes,
    in_file,
    in_linkage,
)
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.drawing import Drawing, DrawnMechanism
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.joints import RobotJoint
from linkage_ros.messages.topics import prefix_of
from linkage_ros.motion.drives import DRIVES
from linkage_ros.motion.drives.base import Drive
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.motion.drives.torque import TorqueDrive
from linkage_ros.quantities import (
    UNKNOWN,
    Leaf,
    build,
    flatten,
    leaves,
    shown,
    unknown_name,
)
from linkage_ros.settings.joints import (
    JointSettings,
    build_joints,
    joint_values,
    robot_joints,
)
from linkage_ros.settings.linkages import LINKAGES, linkage_names, shared_by_all, split
from linkage_ros.settings.old_names import refuse_old_names, with_new_names
from linkage_ros.settings.package_names import read_own_parameters
from linkage_ros.settings.parameters import (
    OF_THE_RUN,
    MechanismAndDrive,
    Session,
    parameter_leaves,
)
from linkage_ros.settings.presets import DEFAULT_PRESET, find_file, preset_path
from linkage_ros.settings.yaml_file import read_parameter_file

_BARS = {4: 'four-bar', 6: 'six-bar', 8: 'eight-bar', 10: 'ten-bar'}
# Parameters that every rclpy node declares.
_ROS_PARAMETERS = ('use_sim_time', 'start_type_description_service')


@dataclass(frozen=True, repr=False)
class Linkage:
    """The configuration of one linkage.

    Attributes:
        kind: The kinds of mechanism and drive.
        mechanism: The mechanism.
        drive: The drive.
        session: Settings for publishing, logging and viewing.
        joints: The robot's joints that are given, by link.
        drawn_mechanism: The mechanism as the parameters draw it; None if they give lengths.
        name: Name of the linkage; empty for the only one, which needs no name.
    """

    kind: MechanismAndDrive
    mechanism: Mechanism
    drive: Drive
    session: Session
    joints: Mapping[str, JointSettings] = field(default_factory=dict)
    drawn_mechanism: DrawnMechanism | None = None
    name: str = ''

    def __repr__(self) -> str:
        driven = self.mechanism.structure().driven_link
        return f'Linkage({self.mechanism!r}, {self.drive.words(driven)})'

    @property
    def mechanism_words(self) -> str:
        """The kind of mechanism, such as 'wind_pump' or 'six-bar (four_bar + ram)'."""
        kind = next(name for name, x in MECHANISMS.items() if type(self.mechanism) is x)
        dyads = [dyad.name for dyad in self.mechanism.dyads]
        if not dyads:
            return kind
        count = len(self.mechanism.structure().links) + 1
        bars = _BARS.get(count, f'{count}-bar')
        if self.mechanism.drawn is not None:  # its dyads have no names of their own
            dyads = [f'{len(dyads)} dyad{"s" * (len(dyads) > 1)}']
        return f'{bars} ({" + ".join([kind, *dyads])})'

    def check_drive(self) -> None:
        """Checks that the drive can move the mechanism.

        Raises:
            LinkageError: It cannot; the message states the reason.
        """
        with (self.drawn_mechanism or self.mechanism).suspicion():
            self.drive.check(self.mechanism)

    @property
    def robot_joints(self) -> tuple[RobotJoint, ...]:
        """The joint of each link in messages."""
        structure, prefix = self.mechanism.structure(), self.session.joint_prefix
        return robot_joints(
            structure.links, self.joints, prefix, driven=structure.driven,
            is_measured=self.drive.is_measured,
        )  # fmt: skip

    @property
    def crank_joint(self) -> str:
        """Name of the driven joint in measurements, commands and trajectories."""
        driven = self.mechanism.structure().driven
        return self.session.crank_joint or self.robot_joints[driven].name

    def parameters(self) -> dict[str, object]:
        """Returns the values of its parameters, without its name, including defaults."""
        parts = (self.kind, self.drawn_mechanism or self.mechanism, self.drive, self.session)
        flat = {name: value for part in parts for name, value in flatten(part).items()}
        known = {leaf.name for leaf in parameter_leaves(self.kind, flat)}
        own = {name: value for name, value in flat.items() if name in known}
        return {**own, **joint_values(self.joints)}


@dataclass(frozen=True, repr=False)
class Configuration:
    """The complete configuration of a run.

    Attributes:
        linkages: The linkages, in the order of their joints in messages. All have one kind of
            drive.
        shared: Values at the top of the parameters, by name; empty for one linkage without a name.
        own: Names of the parameters below the name of each linkage, by that name.
    """

    linkages: tuple[Linkage, ...]
    shared: Mapping[str, object] = field(default_factory=dict)
    own: Mapping[str, frozenset[str]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f'Configuration({", ".join(map(repr, self.linkages))})'

    @property
    def session(self) -> Session:
        """Settings of the run, which all linkages have."""
        return self.linkages[0].session

    @property
    def drive_kind(self) -> type[Drive]:
        """The class of the drives."""
        return type(self.linkages[0].drive)

    @property
    def only(self) -> Linkage:
        """The only linkage.

        Raises:
            ConfigurationError: There are several.
        """
        return self.linkage('')

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of the only linkage."""
        return self.only.mechanism

    @property
    def drive(self) -> Drive:
        """The drive of the only linkage."""
        return self.only.drive

    def linkage(self, name: str) -> Linkage:
        """Returns a linkage.

        Args:
            name: Name of the linkage; empty for the only one.

        Raises:
            ConfigurationError: There is no such linkage, or a name is needed.
        """
        if not name and len(self.linkages) == 1:
            return self.linkages[0]
        for linkage in self.linkages:
            if linkage.name == name:
                return linkage
        names = ', '.join(linkage.name for linkage in self.linkages)
        if not names:
            raise ConfigurationError(f'{shown(name)}: there is one linkage, which has no name')
        choose = 'choose one by its name (option --linkage, parameter linkage)'
        problem = f'{shown(name)} is not one of them' if name else choose
        raise ConfigurationError(f'the linkages are {names}: {problem}')

    def parameters(self) -> dict[str, object]:
        """Returns the values of all parameters by full name, including defaults."""
        values = dict(self.shared)
        for linkage in self.linkages:
            prefix = prefix_of(linkage.name, '.')
            for name, value in linkage.parameters().items():
                if not linkage.name or name in self.own[linkage.name]:
                    values[f'{prefix}{name}'] = value
        return values

    def leaves(self) -> dict[str, Leaf]:
        """Returns the parameters that a run with these linkages may have, by full name."""
        leaves_by_name = dict[str, Leaf]()
        for linkage in self.linkages:
            prefix = prefix_of(linkage.name, '.')
            for leaf in parameter_leaves(linkage.kind, linkage.parameters()):
                leaves_by_name.setdefault(leaf.name, leaf)
                if leaf.name not in OF_THE_RUN:
                    name = f'{prefix}{leaf.name}'
                    leaves_by_name[name] = leaf._replace(name=name)
        return leaves_by_name


def without_ros_parameters(values: Mapping[str, object]) -> dict[str, object]:
    """Removes the parameters that every rclpy node declares."""
    return {name: value for name, value in values.items() if name not in _ROS_PARAMETERS}


def configure(values: Mapping[str, object], *, checks_drive: bool = True) -> Configuration:
    """Validates parameters and creates a configuration.

    Args:
        values: Values by dotted parameter name. If neither 'mechanism' nor 'linkages' is given,
            they override the values of the quadrilateral preset, unless its torque would be sent
            to a controller.
        checks_drive: Whether to refuse a mechanism that its drive cannot move.

    Returns:
        The validated configuration.

    Raises:
        ConfigurationError: A name is unknown or missing, a value is invalid, the links cannot be
            assembled, or the crank cannot turn. The message states what is valid.
    """
    given = without_ros_parameters(values)
    names = linkage_names(given)
    top, own = split(given, names)
    linkages, errors = list[Linkage](), dict[str, ConfigurationError]()
    for name in names:
        default_prefix = {'joint_prefix': f'{name}_'} if name else {}
        of_linkage = {**default_prefix, **top, **own[name]}
        try:
            linkages.append(_configured(name, of_linkage, checks_drive=checks_drive))
        except ConfigurationError as error:
            errors[name] = error
    _check(errors, names)
    if names == ('',):
        return Configuration((linkages[0],))
    _require_compatible(linkages)
    shared, below = shared_by_all({x.name: x.parameters() for x in linkages}, top, own)
    return Configuration(tuple(linkages), shared, below)


def _check(errors: Mapping[str, ConfigurationError], names: Sequence[str]) -> None:
    """Raises the errors of linkages, by name.

    Raises:
        ConfigurationError: There is an error. One that all linkages have, as of a value at the
            top, names none of them.
    """
    words = {str(error) for error in errors.values()}
    if len(words) == 1 and len(errors) == len(names):
        raise errors[names[0]]
    mistakes = Mistakes()
    for name, error in errors.items():
        with mistakes, in_linkage(name):
            raise error
    mistakes.check()


def _configured(name: str, given: Mapping[str, object], *, checks_drive: bool) -> Linkage:
    """Validates the parameters of a linkage, given without its name.

    Raises:
        ConfigurationError: As for `configure`.
    """
    refuse_old_names(given)
    # `build` ignores values of the preset that the drive does not have, such as rpm.
    is_preset = 'mechanism' not in given and not name
    preset = read_parameter_file(preset_path(DEFAULT_PRESET)) if is_preset else {}
    mistakes = Mistakes()
    kind = build(MechanismAndDrive, {**preset, **given})
    with mistakes:
        kind = MechanismAndDrive.of({**preset, **given})
    can_drive = not mistakes
    given, valid = _without_kindless(given, kind, mistakes)
    given = _with_known_names(given, kind, [leaf.name for leaf in valid], mistakes)
    values = {**preset, **given}
    made, mechanism = _built_mechanism(kind, values, mistakes)
    if mechanism is not None and mechanism.drawn:
        values = {'crank_angle': mechanism.drawn.crank_angle, **values}
    drive: Any = None
    session: Any = None
    joints: Any = None
    if can_drive:
        with mistakes:
            drive = build(DRIVES[kind.drive], values)
    with mistakes:
        session = build(Session, values)
    with mistakes:
        joints = build_joints(values)
    if mistakes and mechanism and drive and not drive.is_integrated:
        with mistakes, made.suspicion():
            drive.check(mechanism)
    mistakes.check()
    if is_preset:
        _require_harmless(drive)
    drawn = None if made is mechanism else made
    linkage = Linkage(kind, mechanism, drive, session, joints, drawn_mechanism=drawn, name=name)
    _require_joints(linkage)
    if checks_drive:
        linkage.check_drive()
    return linkage


def _built_mechanism(
    kind: MechanismAndDrive, values: Mapping[str, object], mistakes: Mistakes
) -> tuple[Any, Any]:
    """Builds a mechanism; returns it before and after its conversion, or None after mistakes."""
    is_known = not any(value is UNKNOWN for value in values.values())
    made: Any = None
    mechanism: Any = None
    with mistakes:
        made = build(MECHANISMS[kind.mechanism], values)
        mechanism = made.converted() if is_known else None
    if mechanism is None and is_known:
        return _without_loads(kind, values, mistakes)
    return made, mechanism


def _require_compatible(linkages: Sequence[Linkage]) -> None:
    """Rejects linkages of one run whose kinds of drive, joints or frames contradict each other.

    Raises:
        ConfigurationError: They cannot run together.
    """
    first, owner_of_joint = linkages[0], dict[str, str]()
    first_with_frame = dict[str, Linkage]()
    for linkage in linkages:
        session = linkage.session
        other = first_with_frame.setdefault(session.frame_id, linkage)
        if session.plane != other.session.plane:
            raise ConfigurationError(
                f'{other.name} and {linkage.name} have one frame_id, {shown(session.frame_id)}, '
                'with different planes: give each its own frame_id'
            )
        if linkage.kind.drive != first.kind.drive:
            raise ConfigurationError(
                f'{first.name} has drive: {first.kind.drive}, {linkage.name} has '
                f'{linkage.kind.drive}: all linkages of a run have one kind of drive'
            )
        joints = {joint.name for joint in linkage.robot_joints if joint.name}
        for name in sorted({*joints, linkage.crank_joint}):
            if name in owner_of_joint:
                raise ConfigurationError(
                    f'{owner_of_joint[name]} and {linkage.name} each have a joint {shown(name)}: '
                    'give each its own joint_prefix, joints or crank_joint'
                )
            owner_of_joint[name] = linkage.name


def _require_joints(linkage: Linkage) -> None:
    """Rejects names of joints that contradict each other, or the drive.

    Raises:
        ConfigurationError: There is such a name.
    """
    linkage.session.require_names(linkage.mechanism, linkage.robot_joints)
    if linkage.drive.is_integrated and '' in {joint.name for joint in linkage.robot_joints}:
        raise ConfigurationError(
            "joints: a name is '', but with drive: torque each joint must be published, because a "
            'log of it could not be verified'
        )
    name = linkage.drive.frame_joint_name
    driven = linkage.mechanism.structure().driven
    for number, own in enumerate(linkage.robot_joints):
        if own.name and name == own.name:
            what = 'the crank' if number == driven else 'a joint of this linkage'
            raise ConfigurationError(
                f'frame_joint.name = {shown(name)}: that is {what}; give the joint that '
                'turns base_link'
            )


def _require_harmless(drive: Drive) -> None:
    """Rejects a drive whose messages another machine would follow, if no mechanism is given.

    Raises:
        ConfigurationError: The torque of the default preset might drive a motor.
    """
    names = 'effort_command_topic', 'trajectory_command_topic'
    risky = [f'{name} = {shown(topic)}' for name in names if (topic := getattr(drive, name))]
    if drive.is_measured:
        risky.append('drive = follow')
    if risky:
        raise ConfigurationError(
            f'{" and ".join(risky)}: a mechanism must be given, because the torque of the default '
            f'{DEFAULT_PRESET} would be wrong for any other machine; set mechanism and its links '
            'in a parameter file (--params-file)'
        )


def _without_kindless(
    given: Mapping[str, object], kind: MechanismAndDrive, mistakes: Mistakes
) -> tuple[Mapping[str, object], tuple[Leaf, ...]]:
    """Leaves out loads that have no valid kind, and collects these mistakes.

    Returns:
        The other values, and the parameters that there may be.
    """
    with suppress(ConfigurationError):
        return given, parameter_leaves(kind, given)
    load_of = {x: '.'.join(x.split('.')[:2]) for x in given if x.startswith('loads.')}
    kindless = {*load_of.values()}
    for load in sorted(kindless)[:MOST_LISTED]:
        own = {name: value for name, value in given.items() if name.startswith(f'{load}.')}
        with mistakes:
            parameter_leaves(kind, own)
            kindless.remove(load)
    others = {name: value for name, value in given.items() if load_of.get(name) not in kindless}
    return others, parameter_leaves(kind, others)


def _with_known_names(
    given: Mapping[str, object], kind: MechanismAndDrive, names: Sequence[str], mistakes: Mistakes
) -> Mapping[str, object]:
    """Returns the values with each misspelt name as it is meant, and collects these mistakes.

    Raises:
        ConfigurationError: Other mistakes would be consequences.
    """
    known = {*names}
    allowed, _ = MECHANISMS[kind.mechanism].drives(given)
    if (
        allowed and kind.drive not in allowed
    ):  # the drive is refused: others' parameters may be right
        given = {
            name: value for name, value in given.items()
            if name in known or not _others(name.partition('.')[0], DRIVES, kind.drive)
        }  # fmt: skip
    unknown = [parameter for parameter in given if parameter not in known]
    if not unknown:
        return given
    if kind.mechanism != 'drawing' and any(x.startswith('drawing.') for x in unknown):
        raise ConfigurationError(
            f'mechanism = {shown(kind.mechanism)}, with a drawing: write mechanism: drawing, or '
            'leave drawing out'
        )
    unknown = _unknown_groups(unknown, [*names, *(x.name for x in parameter_leaves(kind))])
    mistakes.count(len(unknown[MOST_LISTED:]))
    changes = dict[str, str]()
    for parameter in unknown[:MOST_LISTED]:
        words, meant = _not_a_parameter(parameter, kind, given, names)
        mistakes.add(words)
        if meant and _can_rename(parameter, meant, given):
            changes[parameter] = meant
    if _lacks_group_of_drawing([x for x in unknown if x not in changes], names):
        mistakes.check()  # without a group, the other mistakes are mostly consequences
    values = {_renamed(name, changes): value for name, value in given.items()}
    for parameter, meant in changes.items():
        if _is_in(parameter, meant):  # names below a value, which they do not give
            values[meant] = UNKNOWN
    return values


def _is_in(name: str, group: str) -> bool:
    """Returns whether a name is that of a group or of a parameter in it."""
    return f'{name}.'.startswith(f'{group}.')


def _can_rename(parameter: str, meant: str, given: Mapping[str, object]) -> bool:
    """Returns whether a parameter or group can have the name that is meant, without a conflict."""
    if _is_in(parameter, meant):
        return True
    renamed = {_renamed(name, {parameter: meant}) for name in given}
    return len(renamed) == len(given)


def _lacks_group_of_drawing(unknown: Sequence[str], names: Sequence[str]) -> bool:
    """Returns whether an unknown name is that of a group which a drawing does not have."""
    groups = {name.split('.')[1] for name in names if name.startswith('drawing.')}
    parts = [name.split('.') for name in unknown]
    return any(x[0] == 'drawing' and x[1] not in groups for x in parts)


def _renamed(name: str, changes: Mapping[str, str]) -> str:
    """Returns a name, in which the name of a group may have changed."""
    for old, new in changes.items():
        if _is_in(name, old):
            return f'{new}{name[len(old) :]}'
    return name


def _without_loads(
    kind: MechanismAndDrive, chosen: Mapping[str, object], mistakes: Mistakes
) -> tuple[Any, Any]:
    """Builds a mechanism without its loads, points and masses, which have mistakes.

    Returns:
        The mechanism before and after its conversion; None if others have mistakes, too.
    """
    bare = {
        name: 0.0 if name.endswith(('.mass', '.inertia')) else value
        for name, value in chosen.items()
        if name.partition('.')[0] not in {'loads', 'points'} and not name.endswith('.center')
    }
    try:
        made = build(MECHANISMS[kind.mechanism], bare)
        return made, made.converted()
    except ConfigurationError as error:
        mistakes.add_new(error)
        return None, None


def _unknown_groups(unknown: Sequence[str], valid: Sequence[str]) -> list[str]:
    """Returns unknown names; those in one unknown group are replaced by the name of the group."""
    known = {group for name in valid for group in _groups_of(name)}
    sizes = Counter(group for name in unknown for group in _groups_of(name))
    groups = list[str]()
    for name in unknown:
        group = next((x for x in _groups_of(name) if x not in known), name)
        groups.append(group if sizes[group] > 1 else name)
    return list(dict.fromkeys(groups))


def _groups_of(name: str) -> list[str]:
    """Returns the groups of a parameter, such as ['a', 'a.b'] of a.b.c."""
    *groups, _ = accumulate(name.split('.'), '{}.{}'.format)
    return groups


def _not_a_parameter(
    name: str, kind: MechanismAndDrive, given: Mapping[str, object], valid: Sequence[str]
) -> tuple[str, str]:
    """Returns the error message for an unknown parameter, and what is meant or ''."""
    owner = _with_article(DRIVES[kind.drive].subject.format(kind.mechanism))
    mistake = f'{shown(name)} is not a parameter of {owner}'
    group = name.partition('.')[0]
    every = [leaf.name for leaf in parameter_leaves(kind)]  # also of groups that are not given
    if kind.mechanism == 'drawing' and any(x.startswith(f'drawing.{group}') for x in every):
        return f'{mistake}: indent {group} below drawing', f'drawing.{name}'
    if name.startswith('drawing.'):
        inner = name.removeprefix('drawing.')
        inner_group = inner.partition('.')[0]
        if inner_group in {'loads', *(x.partition('.')[0] for x in every)}:
            cure = f'{inner_group} is beside drawing, not in it; indent it less'
            return f'{mistake}: {cure}', inner
    if name == 'rate_hz':
        return f'{mistake}: measurements set the rate; leave it out', ''
    if reason := MECHANISMS[kind.mechanism].unused(given).get(name, ''):
        return f'{mistake}: {reason}; leave it out', ''
    # A group that is missing here is named as a whole: only a four_bar has rocker.
    has_group = any(known.startswith(f'{group}.') for known in valid)
    if words := _others_with(name if has_group else group, kind, given):
        return f'{mistake}: {words}', ''
    every = [*valid, *every]
    return unknown_name(name, owner, every, 'linkage_record --help-parameters')


def _others_with(name: str, kind: MechanismAndDrive, given: Mapping[str, object]) -> str:
    """Returns which other drives or mechanisms have a parameter or group, or '' if none has."""
    drives = _others(name, DRIVES, kind.drive)
    mechanisms = _others(name, MECHANISMS, kind.mechanism)
    having = [*(f'a crank with drive: {x}' for x in drives), *map(_with_article, mechanisms)]
    if not having:
        return ''
    cure = 'leave it out'
    allowed, _ = MECHANISMS[kind.mechanism].drives(given)
    if drives and drives[0] in (allowed or drives):
        cure = f'write drive: {drives[0]}, or {cure}'
    return f'only {" or ".join(having)} has {name}; {cure}'


def _with_article(name: str) -> str:
    return f'{"an" if name[0] in "aeiou" else "a"} {name}'


def _others(sought: str, kinds: Mapping[str, type], own: str) -> list[str]:
    """Returns the other kinds that have a parameter or group; empty if `own` has it."""
    having = [
        kind
        for kind, cls in kinds.items()
        if any(f'{leaf.name}.'.startswith(f'{sought}.') for leaf in leaves(cls))
    ]
    return [] if own in having else having


def preset_note(values: Mapping[str, object]) -> str:
    """Returns the prefix of the summary if the default preset is used, otherwise ''."""
    is_given = 'mechanism' in values or LINKAGES in values
    return '' if is_given else f'no mechanism given, so the {DEFAULT_PRESET}: '


def read_values(source: str, namespace: str = '') -> Mapping[str, object]:
    """Reads the values that a parameter file or preset gives to linkage_node, by dotted name.

    The node may have a namespace. Errors are those of `find_file` and `read_own_parameters`.
    """
    path = find_file(source)
    return with_files(read_own_parameters(path, f'{namespace}/linkage_node'), path)


def with_files(values: Mapping[str, Any], path: Path | str) -> dict[str, Any]:
    """Returns values of a parameter file, whose parameters named `file` are relative to it."""
    folder = Path(path).parent
    return {
        name: str(folder / value) if name.endswith('.file') and value else value
        for name, value in values.items()
    }


def load(source: str, *, checks_drive: bool = True) -> Configuration:
    """Reads the configuration from a parameter file or a preset; see `linkage_ros.load`."""
    values = read_values(source)
    with in_file(source):
        return configure(values, checks_drive=checks_drive)


def configuration_of(made: Mechanism | Drawing, rpm: float) -> Linkage:
    """Returns the configuration of a mechanism from Python, or of a drawing, that has no drive.

    Args:
        made: The mechanism or the drawing.
        rpm: Speed of its crank, rpm, if it turns fully.

    Raises:
        ConfigurationError: `MECHANISMS` does not have the class of the mechanism.
    """
    drawn = DrawnMechanism(drawing=made) if isinstance(made, Drawing) else None
    mechanism = made.mechanism() if isinstance(made, Drawing) else made
    kinds = [name for name, cls in MECHANISMS.items() if type(drawn or made) is cls]
    if not kinds:
        raise ConfigurationError(
            f'{type(made).__name__}: must be in MECHANISMS, which has {", ".join(MECHANISMS)}'
        )
    reach = mechanism.reach()
    drive: Drive = TorqueDrive() if reach is None else FollowDrive()
    if reach and reach.turns_fully and not reach.slides:
        drive = SpeedDrive(rpm=rpm)
    kind = next(name for name, cls in DRIVES.items() if type(drive) is cls)
    return Linkage(
        MechanismAndDrive(kinds[0], kind), mechanism, drive, Session(), drawn_mechanism=drawn
    )


def to_strings(configuration: Configuration) -> dict[str, str]:
    """Converts a configuration to JSON strings by parameter name."""
    return {name: json.dumps(value) for name, value in configuration.parameters().items()}


def from_strings(strings: Mapping[str, str]) -> Configuration:
    """Restores a configuration from `to_strings`, also of version 1, with other names.

    Raises:
        ConfigurationError: A value is not JSON, or the configuration is invalid.
    """
    try:
        values = {name: json.loads(text) for name, text in strings.items()}
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f'the logged configuration is not JSON: {error}') from error
    if not {'mechanism', LINKAGES} & {*values}:
        raise ConfigurationError('mechanism is missing from the logged configuration')
    return configure(with_new_names(values))

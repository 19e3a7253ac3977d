# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A study: the designs to evaluate, the measures to compute, constraints and goals."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.stats import qmc

from linkage_lab.sweep.designs import RPM, SPEED
from linkage_lab.sweep.measures import MEASURES, PrescribedMotion, Task
from linkage_ros import ConfigurationError, Mechanism, load
from linkage_ros.formulas import Array
from linkage_ros.internals import Linkage, new_name, read_yaml, reversals
from linkage_ros.quantities import (
    Checked,
    Leaf,
    Quantity,
    build,
    flatten,
    leaves,
    quantity,
    refuse_angles,
    shown,
)

_GROUPS = 'ranges', 'tolerances', 'constraints', 'goals'
_NUMBER = Quantity('number', '')
_GOAL = Quantity('choice', '', choices=('least', 'most'))


@dataclass(frozen=True)
class Settings(Checked):
    """Settings of a study, other than its groups and measures.

    Attributes:
        base: Preset or parameter file of the mechanism.
        designs: Number of designs.
        sampler: Method of choosing designs.
        seed: Seed of the random numbers.
        angles: Number of crank angles per turn.
        rpm: Crank speed, rpm; None for the speed of the base.
        speed: Speed of a driven slide, m/s, instead of `rpm`.
        swing: Crank angles between which the crank moves at this speed, rad; None for the law of
            the base or, if it has none, whole turns.
        point: Name of a traced point of the base; None for its only one.
        points: Points that the traced point should pass through, as x, y, x, y, ..., m.
        linkage: Name of the mechanism, if the base has several; empty for the only one.
    """

    base: str = quantity('text', 'preset, or parameter file, of the mechanism')
    designs: int = quantity('whole', 'number of designs', span=(1, 1e7), default=1024)
    sampler: str = quantity(
        'choice', 'method of choosing designs', choices=('sobol', 'latin_hypercube', 'grid'),
        default='sobol',
    )  # fmt: skip
    seed: int = quantity('whole', 'seed of the random numbers', span=(0, 2**32 - 1), default=0)
    angles: int = quantity('whole', 'crank angles in a turn', span=(12, 36000), default=360)
    rpm: float | None = quantity('number', 'crank speed', 'rpm', span=(-1e6, 1e6), default=None)
    speed: float | None = quantity(
        'number', 'speed of a driven cylinder or slider', 'm/s', span=(-1e6, 1e6), default=None
    )
    swing: tuple[float, float] | None = quantity(
        'pair', 'crank angles between which the crank moves, or positions of a driven slide',
        'rad or m', span=(-1e6, 1e6), default=None,
    )  # fmt: skip
    point: str | None = quantity('text', 'traced point of the base', default=None)
    points: tuple[float, ...] | None = quantity(
        'list',
        'points that the traced point should pass through',
        'm',
        span=(-1e9, 1e9),
        default=None,
    )
    linkage: str = quantity('text', 'linkage of the base, if it has several', default='')


class Study(NamedTuple):
    """A study with its sampled designs.

    Attributes:
        base: Linkage of the base.
        task: The computation for every design.
        columns: The varied parameters with their ranges; defaults are the values of the base.
        designs: Values of these parameters, a row for each design.
        constraints: Smallest and largest value of measures.
        goals: 'least' or 'most' for the two measures of the Pareto front; empty without a front.
    """

    base: Any
    task: Task
    columns: list[Leaf]
    designs: Array
    constraints: dict[str, tuple[float, float]]
    goals: dict[str, str]


def read_study(path: str) -> Study:
    """Reads a study and chooses its designs.

    Raises:
        ConfigurationError: The study is invalid; the message names valid input.
    """
    groups, values = _read_groups(path)
    settings = build(Settings, values)
    base = load(settings.base).linkage(settings.linkage)
    if not base.mechanism.reach():
        raise ConfigurationError(
            f'base = {settings.base}: must be a mechanism whose crank angle determines its motion'
        )
    driven_link = base.mechanism.structure().driven_link
    speed = _speed(settings, base.drive, driven_link)
    columns = _columns(groups, base, speed)
    constraints = {
        name: _span(f'constraints.{name}', value, _NUMBER)
        for name, value in groups['constraints'].items()
    }
    goals = _goals(groups['goals'])
    measures = _measures(values.get('measures', []), goals, constraints)
    coordinates = settings.points or ()
    task = Task(
        base.mechanism,
        speed,
        names=tuple(leaf.name for leaf in columns),
        measures=measures,
        angles=settings.angles,
        points=tuple(map(complex, coordinates[::2], coordinates[1::2])),
        prescribed=_prescribed_motion(settings, base.drive, driven_link),
        point=_point(settings, base.mechanism),
        drawing=base.drawn_mechanism,
    )
    for name in measures:
        if not MEASURES[name].applies(task):
            raise ConfigurationError(f'measure {name}: needs {MEASURES[name].words}')
    return Study(base, task, columns, _designs(settings, columns), constraints, goals)


def _goals(group: Mapping[str, Any]) -> dict[str, str]:
    """Returns 'least' or 'most' for the two measures of the Pareto front, or an empty dict.

    Raises:
        ConfigurationError: A goal is neither of these, or their number is not 0 or 2.
    """
    goals = {name: str(_GOAL.clean(f'goals.{name}', value)) for name, value in group.items()}
    if len(goals) not in {0, 2}:
        raise ConfigurationError(f'goals = {shown(goals)}: must be two measures, or none')
    return goals


def _measures(listed: Any, goals: Iterable[str], constraints: Iterable[str]) -> tuple[str, ...]:
    """Returns the names of all measures, each once: those listed, of goals and of constraints.

    Raises:
        ConfigurationError: There is none, or a name is unknown.
    """
    names = [*(listed if isinstance(listed, list) else [listed]), *goals, *constraints]
    if not names or not MEASURES.keys() >= set(names):
        raise ConfigurationError(f'measures {shown(names)}: choose from {", ".join(MEASURES)}')
    return tuple(dict.fromkeys(names))


def _speed(settings: Settings, drive: Any, driven_link: Any) -> float | None:
    """Returns the speed of the driven joint, m/s if it slides, otherwise rpm; None if not given.

    Without a setting, it is the `rpm` of the drive.

    Raises:
        ConfigurationError: The speed has the unit of another joint.
    """
    if driven_link.slides and settings.rpm is not None:
        raise ConfigurationError(
            f'rpm = {settings.rpm!r}: the {driven_link.driven_word} is driven, which has no rpm; '
            'give speed, m/s'
        )
    if not driven_link.slides and settings.speed is not None:
        raise ConfigurationError(
            f'speed = {settings.speed!r}: the {driven_link.name} is driven; give rpm'
        )
    speed = settings.speed if driven_link.slides else settings.rpm
    return getattr(drive, RPM, None) if speed is None else speed


def _point(settings: Settings, mechanism: Mechanism) -> str:
    """Returns the name of the traced point for `points`; empty if there is none.

    Raises:
        ConfigurationError: The base has no such point, or several of which none is chosen.
    """
    names = [point.name for point in mechanism.points]
    if settings.points and len(names) > 1 and settings.point is None:
        raise ConfigurationError(f'points: give point, one of {", ".join(names)}, to pass through')
    if settings.point is not None and settings.point not in names:
        raise ConfigurationError(
            f'point = {shown(settings.point)}: must be one of the traced points of the base'
            + (f', {", ".join(names)}' if names else ', which has none')
        )
    return settings.point or (names[0] if names else '')


def _prescribed_motion(
    settings: Settings, drive: Any, driven_link: Any
) -> PrescribedMotion | None:
    """Returns the motion within the swing or along the law of the drive; None for whole turns.

    Raises:
        ConfigurationError: The swing is empty, or missing for a driven slide without a law.
    """
    if settings.swing is not None:
        low, high = settings.swing
        if driven_link.slides:
            refuse_angles('swing', settings.swing, f'the {driven_link.driven_word}')
        if not low < high:
            raise ConfigurationError(
                f'swing = {shown(settings.swing)}: give the smaller angle first'
            )
        return PrescribedMotion(low, high)
    has_speed = settings.rpm is not None or settings.speed is not None
    law = None if has_speed else drive.law(driven_link)
    if law is not None:
        times = {0, law.duration, *law.extremes(math.inf, -math.inf)}
        ends = [moment.turns * math.tau + moment.angle for moment in map(law.at, times)]
        return PrescribedMotion(min(ends), max(ends), law, tuple(reversals(law)))
    if driven_link.slides:
        raise ConfigurationError(
            f'the {driven_link.driven_word} is driven: give swing, the positions between which it '
            'moves, m'
        )
    return None


def _read_groups(path: str) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """Reads a study; returns its groups by name, and all its values.

    Raises:
        ConfigurationError: The file cannot be read, or contains an unknown name.
    """
    values: dict[str, Any] = read_yaml(path, 'study')
    known = [*(leaf.name for leaf in leaves(Settings)), 'measures', *_GROUPS]
    groups: dict[str, dict[str, Any]] = {group: {} for group in _GROUPS}
    for name, value in values.items():
        group, _, parameter = name.partition('.')
        if name in groups:
            raise ConfigurationError(f'{name} = {shown(value)}: write {name}: {{NAME: VALUE}}')
        if group in groups:
            groups[group][parameter] = value
        elif name not in known:
            raise ConfigurationError(_unknown(name, 'a study', known))
    return groups, values


def _columns(
    groups: Mapping[str, Mapping[str, Any]], base: Linkage, speed: float | None
) -> list[Leaf]:
    """Returns the parameters in which designs differ, with their ranges.

    Raises:
        ConfigurationError: No parameter is given, or a parameter is unknown, given twice or out of
            range.
    """
    mechanism = base.drawn_mechanism or base.mechanism
    valid = {leaf.name: leaf for leaf in parameters(mechanism, speed)}
    columns: dict[str, Leaf] = {}
    for group in ('ranges', 'tolerances'):
        for name, value in groups[group].items():
            if name not in valid:
                raise ConfigurationError(_unknown(name, f'this {base.kind.mechanism}', valid))
            if name in columns:
                raise ConfigurationError(f'{name} has a range and a tolerance: leave one out')
            leaf = valid[name]
            is_tolerance = group == 'tolerances'
            limits = _around_default(base, leaf, value) if is_tolerance else value
            low, high = _span(f'{group}.{name}', limits, leaf.quantity)
            _reject_degrees_of_slide(base, name, (low, high))
            columns[name] = leaf._replace(quantity=replace(leaf.quantity, low=low, high=high))
    if not columns:
        raise ConfigurationError('nothing varies: give ranges or tolerances of parameters')
    return [*columns.values()]


def _around_default(base: Linkage, leaf: Leaf, value: Any) -> list[Any]:
    """Returns the limits of a tolerance, which are equally far from the value of the base."""
    number = replace(_NUMBER, unit=leaf.quantity.unit)
    tolerance: Any = number.clean(f'tolerances.{leaf.name}', value)
    _reject_degrees_of_slide(base, leaf.name, tolerance)
    middle: Any = leaf.default
    return [middle - tolerance, middle + tolerance]


def _reject_degrees_of_slide(base: Linkage, name: str, value: object) -> None:
    """Rejects angles in degrees for a parameter of a load on a sliding link.

    Raises:
        ConfigurationError: The value has such an angle.
    """
    load_name = name.rpartition('.')[0]
    loaded_link = base.parameters().get(f'{load_name}.link')
    for link in base.mechanism.structure().links:
        if link.slides and link.name == loaded_link:
            refuse_angles(name, value, f'the {loaded_link}')


def _unknown(name: str, owner: str, valid: Iterable[str]) -> str:
    """Returns the message about an unknown parameter, with its new name or the valid names."""
    renamed = new_name(name)
    hint = f'write {renamed}, with a name of the base' if renamed else ''
    return (
        f'{shown(name)} is not a parameter of {owner}: {hint or "choose from " + ", ".join(valid)}'
    )


def _span(name: str, value: object, allowed: Quantity) -> tuple[float, float]:
    """Reads a range: two numbers, the smaller one first.

    Raises:
        ConfigurationError: The value is not a valid range.
    """
    low, high = cast('tuple[float, float]', replace(allowed, kind='pair').clean(name, value))
    if not low < high:
        raise ConfigurationError(
            f'{name} = {shown(value)}: empty range; give the smaller number first'
        )
    return low, high


def parameters(mechanism: Any, speed: float | None) -> Iterator[Leaf]:
    """Yields the parameters that can vary, with the values of the base as defaults.

    Args:
        mechanism: The base mechanism, or its drawing.
        speed: Speed of the driven joint, rpm or m/s; None if there is none.
    """
    values: dict[str, Any] = flatten(mechanism)
    if drawing := getattr(mechanism, 'drawing', None):
        values |= {f'drawing.links.{name}.length': x for name, x in drawing.lengths.items()}
    for leaf in leaves(type(mechanism), values=values):
        if leaf.name not in values:  # optional, and missing from the base
            continue
        value = values[leaf.name]
        if leaf.quantity.kind == 'number':
            yield leaf._replace(default=value)
        elif leaf.quantity.kind == 'pair':
            yield from (Leaf(f'{leaf.name}.{i}', leaf.quantity, x) for i, x in enumerate(value))
    if speed is not None:
        setting = SPEED if mechanism.converted().structure().driven_link.slides else RPM
        settings = {leaf.name: leaf for leaf in leaves(Settings)}
        yield settings[setting]._replace(default=speed)


def _designs(settings: Settings, columns: Sequence[Leaf]) -> Array:
    """Samples the parameters; returns a row for each design, a column for each parameter.

    Raises:
        ConfigurationError: The grid would have only one value per parameter.
    """
    count, size = settings.designs, len(columns)
    if settings.sampler == 'grid':
        values_each = int(count ** (1 / size) + 1e-9)
        if values_each < 2:
            raise ConfigurationError(
                f'designs = {count}: a grid needs at least {2**size}, two values of each parameter'
            )
        shares = np.indices([values_each] * size).reshape(size, -1).T / (values_each - 1)
    elif settings.sampler == 'sobol':
        # SciPy warns unless the number of samples is a power of 2.
        sampler = qmc.Sobol(size, seed=settings.seed)
        shares = sampler.random_base2(math.ceil(math.log2(count)))[:count]
    else:
        shares = qmc.LatinHypercube(size, seed=settings.seed).random(count)
    low = [leaf.quantity.low for leaf in columns]
    high = [leaf.quantity.high for leaf in columns]
    return np.asarray(qmc.scale(shares, low, high))

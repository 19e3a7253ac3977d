# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart state: motion and forces at one position, for every assembly."""

import argparse
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from linkage_lab.assemblies import choices, combined
from linkage_lab.output import load_pose, new_file, save_csv
from linkage_lab.period import SLIDING, TURNING
from linkage_lab.sampling import without_loads
from linkage_ros import ConfigurationError, LinkageError, Mechanism, Solver, State, cli
from linkage_ros.internals import STANDARD_OUTPUT, radians_per_second

_MOST, _TRIED = 16, 1024  # assemblies shown, and tried
_ONLY = 'one assembly'


class Value(NamedTuple):
    """A quantity at one position.

    Attributes:
        unit: SI unit of the value.
        value: The value.
    """

    unit: str
    value: float


class Snapshot(NamedTuple):
    """Motion and forces of one assembly at one position.

    Attributes:
        assembly: Names of the assemblies of the loop and of each dyad.
        values: Quantities by name, such as 'coupler.direction'.
        missing: Reason why the driving force ('driving') or the joint forces ('joint') could not
            be computed; empty if all could.
        is_own: Whether this is the assembly of the file.
    """

    assembly: str
    values: dict[str, Value]
    missing: dict[str, str]
    is_own: bool = False


def state(options: argparse.Namespace) -> None:
    """Prints and, with --csv, writes motion and forces at one position.

    Raises:
        ConfigurationError: The mechanism or an option is invalid.
        UnreachableError: No assembly exists at this position.
    """
    table = options.csv and new_file(options, options.csv)
    design, notes = load_pose(options)
    place, speed, words = position_and_speed(design, options)
    found, more = snapshots(design, place, speed, options.acceleration)
    cli.print_notes([*notes, *more])
    if options.json:
        cli.print_json({
            'position': words,
            'assemblies': [
                {
                    'assembly': one.assembly,
                    'is_own': one.is_own,
                    'values': {name: x._asdict() for name, x in one.values.items()},
                    'missing': one.missing,
                }
                for one in found
            ],
        })  # fmt: skip
    elif table != Path(STANDARD_OUTPUT):
        own = 'as drawn' if design.mechanism.drawn else 'as in the file'
        for one in found:
            mark = f' ({own})' if one.is_own and one.assembly != _ONLY else ''
            print(*_table(one, f'{one.assembly}{mark}: {words}'), '', sep='\n')
    if table:
        save_csv(table, *_rows(found))


def position_and_speed(design: Any, options: argparse.Namespace) -> tuple[float, float, str]:
    """Returns position and speed of the driven joint, rad or m, and describes them.

    Args:
        design: The configuration.
        options: Parsed command-line options: `at`, `rpm` and `speed`, each None if not given, and
            `acceleration`.

    Raises:
        ConfigurationError: An option does not apply to the driven joint.
    """
    driven = design.mechanism.structure().driven_link
    place = design.drive.drawn_angle(design.mechanism) if options.at is None else options.at
    if driven.slides:
        if options.rpm is not None:
            raise ConfigurationError(f'--rpm: {driven.name} slides; give --speed in m/s')
        speed = options.speed or 0.0
        moves = f'{place:.6g} m, {speed:g} m/s, {options.acceleration:g} m/s^2'
        return place, speed, f'{driven.name} at {moves}'
    if options.speed is not None:
        raise ConfigurationError(f'--speed: {driven.name} turns; give --rpm')
    # With drive: torque the crank starts at start_rpm; a law or a measured crank has no rpm.
    own = getattr(design.drive, 'rpm', getattr(design.drive, 'start_rpm', 0.0))
    rpm = own if options.rpm is None else options.rpm
    moves = f'{math.degrees(place):.6g} deg, {rpm:g} rpm, {options.acceleration:g} rad/s^2'
    return place, radians_per_second(rpm), f'{driven.name} at {moves}'


def snapshots(
    design: Any, place: float, speed: float, acceleration: float = 0.0
) -> tuple[list[Snapshot], list[str]]:
    """Computes motion and forces of each assembly that exists at a position.

    Args:
        design: The configuration.
        place: Position of the driven joint, rad or m.
        speed: Speed of the driven joint, rad/s or m/s.
        acceleration: Acceleration of the driven joint, rad/s^2 or m/s^2. It is ignored for a wind
            pump, whose acceleration is computed.

    Returns:
        At most 16 snapshots, the first that of the configuration if it exists; and notes.

    Raises:
        UnreachableError: No assembly exists at this position.
    """
    found, refusals, notes = list[Snapshot](), list[LinkageError](), list[str]()
    for number, (words, mechanism) in enumerate(assemblies(design.mechanism)):
        try:
            one = _snapshot(words, mechanism, design.drive, place, speed, acceleration)
        except LinkageError as error:
            if not found and not refusals:
                notes.append(f'{words}: {error}')
            refusals.append(error)
            continue
        if len(found) == _MOST:
            notes.append(f'there are more than these {_MOST} assemblies')
            break
        found.append(one._replace(is_own=number == 0))
    if not found:
        raise refusals[0]
    return found, notes


def assemblies(mechanism: Mechanism) -> Iterator[tuple[str, Mechanism]]:
    """Yields a mechanism in each combination of assemblies of its loop and dyads, its own first.

    Yields:
        The assemblies in words, and the mechanism.
    """
    loop_choices, *dyad_choices = choices(mechanism)
    combinations = itertools.product(loop_choices, *dyad_choices)
    for loop, *dyads in itertools.islice(combinations, _TRIED):
        words = [loop.assembly] if len(loop_choices) > 1 else []
        words += [dyad.assembly_words for dyad in dyads if dyad.has_assemblies]
        yield ', '.join(words) or _ONLY, combined([loop, *dyads])


def _snapshot(
    words: str, mechanism: Mechanism, drive: Any, place: float, speed: float, acceleration: float
) -> Snapshot:
    """Computes one assembly.

    Args:
        words: Name of the assembly.
        mechanism: The mechanism in this assembly.
        drive: The drive, whose motor accelerates a wind pump.
        place: Position of the driven joint.
        speed: Speed of the driven joint.
        acceleration: Acceleration of the driven joint; a wind pump ignores it.

    Raises:
        LinkageError: The assembly does not exist at this position.
    """
    solver = Solver(mechanism)
    frictionless = without_loads(solver) if solver.model.joint_loads else solver
    positions, rates = mechanism.start()  # of the coordinates other than the crank angle
    q, u, a = (place, *positions), (speed, *rates), (acceleration,)
    if positions:
        torque = drive.motor.torque - drive.motor.damping * speed
        a = frictionless.accelerations(q, u, torque)
    values = _motion_values(solver, frictionless.state(q, u, a))
    if transmission := getattr(cast('Any', mechanism).loop(), 'transmission', None):
        halves = transmission.half_angles(place)
        values['transmission_angle'] = Value('rad', 2 * math.atan2(halves.sin_m, halves.cos_m))
    values |= _spring_values(solver, frictionless, (q, u, a))
    missing = dict[str, str]()
    try:
        values |= _driving(solver, (q, u, a))
    except LinkageError as error:
        missing['driving'] = str(error)
    try:
        values |= _joints(solver, (q, u, a))
    except LinkageError as error:
        missing['joint'] = str(error)
    return Snapshot(words, values, missing)


def _motion_values(solver: Solver, state: State) -> dict[str, Value]:
    """Returns position, velocity and acceleration of the links and points, by name."""
    values = dict[str, Value]()
    for link in solver.structure.links:
        names = SLIDING if link.slides else TURNING
        motion = cast('tuple[float, ...]', state[link.name])
        for (name, unit), value in zip(names, motion, strict=True):
            values[f'{link.name}.{name}'] = Value(unit, value)
    for point in solver.structure.points:
        for (name, unit), vector in zip(SLIDING, solver.point(state, point), strict=True):
            values |= _vector_values(f'{point}.{name}', unit, vector)
    return values


def _spring_values(
    solver: Solver, frictionless: Solver, motion: tuple[Any, ...]
) -> dict[str, Value]:
    """Returns length, rate, leverage and tension of springs and cylinders, by name."""
    values, loads = dict[str, Value](), {load.name for load in solver.mechanism.loads}
    place, *_ = motion
    for name in solver.springs:
        length, rate, tension = solver.spring(frictionless.state(*motion), name)
        values[f'{name}.length'] = Value('m', float(length))
        values[f'{name}.length_rate'] = Value('m/s', float(rate))
        if len(place) == 1:
            unit = f'm/{solver.structure.driven_link.units.position}'
            leverage = solver.spring(frictionless.state(place, 1.0), name).rate
            values[f'{name}.leverage'] = Value(unit, float(leverage))
        if name in loads:
            values[f'{name}.tension'] = Value('N', float(tension))
    return values


def _vector_values(name: str, unit: str, vector: Sequence[float]) -> dict[str, Value]:
    """Returns the components of a vector as NAME.x and NAME.y."""
    return {f'{name}.{axis}': Value(unit, x) for axis, x in zip('xy', vector, strict=True)}


def _driving(solver: Solver, motion: tuple[Any, ...]) -> dict[str, Value]:
    """Computes the driving torque or force, and the loads on the links.

    Args:
        solver: The solver.
        motion: Positions, rates and accelerations of the coordinates.

    Raises:
        LinkageError: Friction locks the mechanism.
    """
    state, driven = solver.state(*motion), solver.structure.driven_link
    word = 'force' if driven.slides else 'torque'
    values = {f'driving_{word}': Value(driven.units.effort, state.torque)}
    exerted = solver.exerted(state)
    links = {link.name: link for link in solver.structure.links}
    for name, effort in exerted.efforts.items():
        values[f'{name}.load'] = Value(links[name].units.effort, effort)
    for name, force in exerted.forces.items():
        values |= _vector_values(f'{name}.force', 'N', force.force)
    return values


def _joints(solver: Solver, motion: tuple[Any, ...]) -> dict[str, Value]:
    """Computes pin forces, guide forces, shaking force and shaking moment; see `_driving`."""
    reactions = solver.reactions(solver.state(*motion))
    values = dict[str, Value]()
    for name, force in reactions.pins.items():
        values |= _vector_values(f'pin_{name}', 'N', force)
    values |= _vector_values('shaking_force', 'N', reactions.shaking_force)
    for name, guide in reactions.guides.items():
        values[f'{name}.guide_force'] = Value('N', guide.force)
        values[f'{name}.guide_moment'] = Value('N m', guide.moment)
    return values | {'shaking_moment': Value('N m', reactions.shaking_moment)}


def _table(one: Snapshot, title: str) -> Iterator[str]:
    """Yields the lines of a table: title, links, points, missing forces, other quantities."""
    values = one.values
    points = [name.removesuffix('.velocity.x') for name in values if '.velocity.x' in name]
    width = 2 + max(12, *(len(name.partition('.')[0]) for name in values))
    yield title
    yield f'  {"link":<{width}}{"position":>18}{"velocity":>20}{"acceleration":>22}'
    tabulated = list[str]()
    for name in values:
        link, _, word = name.rpartition('.')
        if motion := {'position': SLIDING, 'direction': TURNING}.get(word):
            names = [f'{link}.{quantity}' for quantity, _ in motion]
            yield _row(link, [values[name] for name in names], width, (18, 20, 22))
            tabulated += names
    heads = 'x', 'y', 'velocity x', 'y', 'acceleration x', 'y'
    widths = 14, 14, 14, 14, 16, 14
    head = ''.join(f'{word:>{size}}' for word, size in zip(heads, widths, strict=True))
    yield f'  {"point":<{width}}{head}   in m and s'
    for point in points:
        names = [f'{point}.{word}.{axis}' for word, _ in SLIDING for axis in 'xy']
        yield _row(point, [values[name] for name in names], width, widths, with_units=False)
        tabulated += names
    if 'driving' in one.missing:
        yield f'  driving torque or force: none: {one.missing["driving"]}'
    if 'joint' in one.missing:
        yield f'  joint forces: none: {one.missing["joint"]}'
    yield from _single_rows({x: y for x, y in values.items() if x not in tabulated})


def _single_rows(values: Mapping[str, Value]) -> Iterator[str]:
    """Yields a line for each quantity; for a vector, one for both components."""
    for name, value in values.items():
        if name.endswith('.x'):
            vector = name.removesuffix('.x')
            yield _row(f'{vector} (x, y)', [value, values[f'{vector}.y']], 32, (14, 14))
        elif not name.endswith('.y'):
            yield _row(name, [value], 32, (14,))


def _row(
    name: str, cells: list[Value], width: int, widths: tuple[int, ...], *, with_units: bool = True
) -> str:
    shown = [_shown(cell, with_units=with_units) for cell in cells]
    return f'  {name:<{width}}' + ''.join(f'{x:>{w}}' for x, w in zip(shown, widths, strict=False))


def _shown(cell: Value, *, with_units: bool) -> str:
    """Writes a value with six digits; an angle in degrees."""
    unit, value = cell
    if unit == 'rad':
        unit, value = 'deg', math.degrees(value)
    text = f'{round(value, 12) + 0.0:.6g}'
    return f'{text} {unit}' if with_units else text


def _rows(found: list[Snapshot]) -> tuple[list[str], list[list[object]]]:
    """Returns the head and the rows of a CSV file, one for each assembly."""
    units = {name: value.unit for one in found for name, value in one.values.items()}
    head = ['assembly', *(f'{name} [{unit}]' for name, unit in units.items())]
    rows = list[list[object]]()
    for one in found:
        numbers = {name: value.value for name, value in one.values.items()}
        rows.append([one.assembly, *map(numbers.get, units)])
    return head, rows

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Notes values of a configuration that are possible, but probably a mistake."""

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

import numpy as np

from linkage_ros.errors import UnreachableError
from linkage_ros.mechanism.axes import carriers_of
from linkage_ros.mechanism.drawing import Drawing
from linkage_ros.mechanism.drawing_checks import contradictions
from linkage_ros.mechanism.exact import UNITS
from linkage_ros.mechanism.loads.force import Force
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.joints import own_joints
from linkage_ros.messages.topics import prefix_of
from linkage_ros.motion.drives.law import LawDrive, Prescribed
from linkage_ros.numeric import Array
from linkage_ros.quantities import Angle, leaves
from linkage_ros.settings.configuration import Configuration, Linkage
from linkage_ros.settings.parameters import parameter_leaves

_LONG, _SHORT = 10.0, 1e-4  # m
_FAR = 20.0  # distance relative to the longest link, beyond that of any usual point
# A steel cube whose edge is 1.5 times the link, kg/m^3. Usual links are a hundredth of it.
_DENSEST = 27e3
_FEW = 10.0  # states per turn, whose values between the states cannot be guessed
_POINTS = 20  # the fewest points of a law whose rounding is judged
# Accelerations at all points, relative to those at every second and fourth point, rms. Rounding
# errors give up to 4 and 16, a sine with six points per period gives 1.3 and 5.3.
_ROUGH = {2: 2.5, 4: 6.0}
_NEAR = 1e-3  # rad or m from the drawn position
_STILL = 1e-12  # rad or m per rad or m of the input; a slower link stands still
_NEGLIGIBLE = 1e-3  # change of speed from point to point, relative to the speed, rms


def notes(configuration: Configuration) -> list[str]:
    """Returns a line for each value of a run that is probably a mistake; see `notes_on`."""
    return [
        f'{prefix_of(linkage.name, ": ")}{line}'
        for linkage in configuration.linkages
        for line in notes_on(linkage)
    ]


def notes_on(linkage: Linkage) -> list[str]:
    """Returns a line for each value of a linkage that is probably a mistake.

    Most were probably given in another unit, and the line also states the value in that unit.
    """
    return [
        *_zero(linkage),
        *_angles(linkage),
        *_lengths(linkage),
        *(contradictions(linkage.drawn_mechanism.drawing) if linkage.drawn_mechanism else ()),
        *_places(linkage),
        *_beside_slides(linkage),
        *_masses(linkage),
        *_near_change_point(linkage),
        *_standing(linkage),
        *_rigid(linkage),
        *_rate(linkage),
        *_rounding(linkage),
        *_nothing(linkage),
    ]


def _standing(linkage: Linkage) -> Iterator[str]:
    """Notes links of a drawing that do not move: a pin was probably given to another link."""
    mechanism = linkage.mechanism
    if mechanism.drawn is None:
        return
    solver = Solver(replace(cast('Any', mechanism), loads=()))
    start = mechanism.drawn.position
    fastest = np.zeros(len(solver.links))
    for place in (start, start + _NEAR, start - _NEAR):  # a dead centre is at one place alone
        with suppress(UnreachableError):
            fastest = np.maximum(fastest, _speeds(solver, place))
    still = [x for x, speed in zip(solver.links, fastest, strict=True) if speed < _STILL]
    if still:
        yield (
            f'{", ".join(still)}: without motion, whatever {solver.structure.driven_link.name} '
            'does; compare the pins of these links and of their neighbours'
        )


def _speeds(solver: Solver, place: float) -> Array:
    """Returns the largest of each link's rate and of the speeds of its pins.

    Args:
        solver: Solver of the mechanism.
        place: Place of the driven joint, whose rate is 1.

    Raises:
        UnreachableError: The mechanism cannot be there.
    """
    state = solver.state(place, 1.0)
    speeds = np.abs(state.velocity)
    for pin in solver.structure.pins:
        speed = math.hypot(*solver.point(state, pin.name).velocity)
        for j in (pin.first, pin.second):
            if j is not None:
                speeds[j] = max(speeds[j], speed)
    return speeds


def _rigid(linkage: Linkage) -> Iterator[str]:
    """Notes dyads that do not move relative to the link that has both of their ends."""
    structure = linkage.mechanism.structure()
    carriers = carriers_of(structure.pins, structure.links)
    for i, carrier in enumerate(structure.links):
        carried = [
            link.name for j, link in enumerate(structure.links) if j != i and carriers[j] == i
        ]
        if carried:
            yield (
                f'{", ".join(carried)}: rigid with {carrier.name}, so that their joints '
                'have no motion and no friction; give them as one link, or correct an end'
            )


def _zero(linkage: Linkage) -> Iterator[str]:
    """Notes a measured joint that is taken as equal to the own joint, without its zero."""
    structure, given = linkage.mechanism.structure(), linkage.joints
    link, joint = structure.driven_link, linkage.robot_joints[structure.driven]
    own = own_joints(structure.links, linkage.session.joint_prefix)[structure.driven]
    is_given = link.name in given and given[link.name].zero is not None
    if not linkage.drive.is_measured or joint.name == own.name or is_given:
        return
    meaning = f'a {link.name} at 0 m' if link.slides else 'the direction of +x'
    yield (
        f"joints.{link.name}.zero is not given, so zero 0: {joint.name}'s 0 is taken as {meaning}"
    )


def _angles(linkage: Linkage) -> Iterator[str]:
    """Notes angles of more than a turn, which were probably meant in degrees."""
    values = linkage.parameters()
    structure = linkage.mechanism.structure()
    links = structure.links
    turning = [f'joints.{link.name}.zero' for link in links if not link.slides]
    if not structure.driven_link.slides:
        turning += ['motion.center', 'motion.amplitude']
    for name, quantity, _ in parameter_leaves(linkage.kind, values):
        value = values.get(name)
        is_angle = quantity.unit == 'rad' or (name in turning and not isinstance(value, Angle))
        if is_angle and isinstance(value, float) and abs(value) > 2 * math.pi:
            yield (
                f'{name} = {value:g} rad = {math.degrees(value) % 360:.4g} deg after whole turns; '
                f'did you mean {value:g}deg = {math.radians(value):.4g} rad?'
            )


def _link_lengths(linkage: Linkage) -> dict[str, float]:
    """Returns lengths by their parameters, m; in a drawing, those of its links."""
    if linkage.drawn_mechanism is None:
        return {
            name: value
            for name, value in linkage.parameters().items()
            if name.endswith('.length') and isinstance(value, float)
        }
    lengths, parts = dict[str, float](), linkage.mechanism.parts()
    for link in linkage.drawn_mechanism.drawing.links:
        part = parts[link.name]
        if hasattr(part, 'length'):
            lengths[f'drawing.links.{link.name}.length'] = part.length
    return lengths


def _lengths(linkage: Linkage) -> Iterator[str]:
    """Notes lengths that were probably meant in another unit."""
    lengths = _link_lengths(linkage)
    if not lengths:
        return
    if linkage.drawn_mechanism is not None:
        unit = linkage.drawn_mechanism.drawing.units
        name, value = max(lengths.items(), key=lambda item: item[1])
        if not _SHORT <= value <= _LONG:
            link = name.split('.')[2]
            yield (
                f'drawing.units = {unit}, so that the longest link, {link}, has {value:g} m; did '
                f'you mean units: {"mm" if value > _LONG else "m"}?'
            )
        return
    for name, value in lengths.items():
        if value > _LONG:
            yield f'{name} = {value:g} m; did you mean {value:g} mm = {value * 1e-3:g} m?'
        elif value < _SHORT:
            yield f'{name} = {value:g} m = {value * 1e3:g} mm; did you mean {value * 1e3:g} m?'


def _longest(linkage: Linkage) -> float:
    """Returns the length of the longest link, m; of a drawing, at least its width and height."""
    lengths = [*_link_lengths(linkage).values()]
    if linkage.drawn_mechanism is not None:
        drawing = linkage.drawn_mechanism.drawing
        columns = zip(*drawing.pins.values(), strict=True)
        lengths += [float(UNITS[drawing.units]) * (max(x) - min(x)) for x in columns]
    return max(lengths, default=0)


def _places(linkage: Linkage) -> Iterator[str]:
    """Notes points in mm: centres of mass, and points of loads and dyads."""
    values, longest = linkage.parameters(), _longest(linkage)
    if linkage.drawn_mechanism is not None:
        yield from _drawn_places(linkage, linkage.drawn_mechanism.drawing, longest)
        return
    for name, quantity, _ in leaves(MECHANISMS[linkage.kind.mechanism], values=values):
        place = values.get(name)
        if quantity.kind != 'pair' or quantity.unit != 'm' or not isinstance(place, tuple):
            continue
        if 0 < _FAR * longest < math.hypot(*place):
            x, y = (f'{value * 1e-3:g}' for value in place)
            yield (
                f'{name} = [{place[0]:g}, {place[1]:g}] m, where the longest link has '
                f'{longest:g} m; did you mean mm = [{x}, {y}] m?'
            )


def _drawn_places(linkage: Linkage, drawing: Drawing, longest: float) -> Iterator[str]:
    """Notes centres of mass and loads that are far from their links in a drawing."""
    mechanism, unit = linkage.mechanism, drawing.units
    places = [
        *(
            (f'the center of {x}', getattr(y, 'center', None))
            for x, y in mechanism.parts().items()
        ),
        *((f'loads.{load.name}.at', getattr(load, 'at', None)) for load in mechanism.loads),
    ]
    for name, place in places:
        if place and 0 < _FAR * longest < math.hypot(*place):
            yield (
                f'{name} is {math.hypot(*place):.3g} m from its link as drawn, where the longest '
                f'link has {longest:.3g} m; is it a place in the drawing, in {unit}?'
            )


def _beside_slides(linkage: Linkage) -> Iterator[str]:
    """Notes forces at the pin of a slide that act on another link there, as none is given."""
    if linkage.drawn_mechanism is None:
        return
    acting = {load.name: load for load in linkage.mechanism.loads}
    for load in linkage.drawn_mechanism.loads:
        if not isinstance(load, Force) or not load.pin or load.link:
            continue
        slides = linkage.drawn_mechanism.drawing.slides
        names = [slide.name for slide in slides if load.pin in slide.all_pins]
        link = cast('Force', acting[load.name]).link
        if names and link not in names:
            yield (
                f'{load.label}: the force at {load.pin} acts on {link}, not on the slide '
                f'{names[0]}, so that the pin {load.pin} does not carry it; beside pin: '
                f'{load.pin}, write link: {names[0]}, or link: {link} if that is meant'
            )


def _masses(linkage: Linkage) -> Iterator[str]:
    """Notes masses in g, which are far above those of steel links of the same size."""
    values, longest = linkage.parameters(), _longest(linkage)
    lengths, drawn = _link_lengths(linkage), linkage.mechanism.drawn
    cranks = {'crank', f'drawing.links.{drawn.links[0]}' if drawn else ''}
    for name, mass in values.items():
        part, _, field = name.rpartition('.')
        if field != 'mass' or not isinstance(mass, float) or not mass:
            continue
        length = lengths.get(f'{part}.length')
        if length is None or part in cranks:  # a crank may be a disc, larger than its length
            length = longest
        inertia = values.get(f'{part}.inertia')
        gyration = math.sqrt(inertia / mass) if isinstance(inertia, float) else 0.0
        size = max(length, gyration)
        if 0 < _DENSEST * size**3 < mass:
            yield (
                f'{name} = {mass:g} kg, more than a cube of steel with an edge of '
                f'{1.5 * size:.3g} m; did you mean {mass:g} g = {mass * 1e-3:g} kg?'
            )


def _near_change_point(linkage: Linkage) -> Iterator[str]:
    """Notes sums of drawn lengths that are probably meant to be 0, as in a parallelogram.

    Coordinates of few digits, or those of a CAD program, give such sums.
    """
    mechanism = linkage.mechanism
    if not mechanism.drawn or not (reach := mechanism.reach()) or not reach.near_equalities:
        return
    sums = '; '.join(mechanism.in_own_terms(reach).near_equalities)
    length = f'drawing.links.{mechanism.drawn.links[0]}.length'
    yield (
        f'of the lengths drawn, {sums}: nearly a change point; if it is to be 0, give a link of '
        f'the loop its length, such as {length}, which replaces the distance drawn'
    )


def _rate(linkage: Linkage) -> Iterator[str]:
    """Notes a rate with too few states per turn, or per period of a law."""
    drive, rate = linkage.drive, linkage.session.rate_hz
    per_second, word = 0.0, 'turn'
    if isinstance(drive, LawDrive):
        law = drive.motion.law
        if law.repeats:
            per_second = max(1, abs(law.turns or 0)) * 1e9 / law.duration
            word = 'turn' if law.turns else 'period of the motion'
    else:
        per_second = abs(getattr(drive, 'rpm', None) or 0.0) / 60
    if per_second and rate < _FEW * per_second:
        yield (
            f'rate_hz = {rate:g} gives {rate / per_second:.3g} states per {word}, and the peaks '
            f'are between them; did you mean {60 * per_second:.4g} Hz, 60 states per {word}?'
        )


def _rounding(linkage: Linkage) -> Iterator[str]:
    """Notes points of a law whose rounding errors dominate its accelerations."""
    drive = linkage.drive
    if not isinstance(drive, LawDrive):
        return
    excess = _roughness(drive.motion)
    if excess:
        yield (
            f'the points of motion are rounded or noisy: they give accelerations {excess:.2g} '
            'times those through every fourth point; did you mean fewer points, or points with '
            'more digits? Of a measured motion, drive: follow and linkage_record --measured '
            'filter the points'
        )


def _roughness(motion: Prescribed) -> float:
    """Compares second differences of all points with those of every fourth point.

    Returns:
        Their quotient, rms, if it is due to errors of many points; otherwise 0. It is 0, too, for
        few points.
    """
    times, places = np.array(motion.times or ()), np.array(motion.places or ())
    if len(times) < _POINTS:
        return 0.0
    differences = {n: _second_differences(times, places, n) for n in (1, *_ROUGH)}
    rms = {n: math.sqrt(np.mean(row**2)) for n, row in differences.items()}
    rms_step = math.sqrt(np.mean(np.diff(places) ** 2))
    if rms[1] <= _NEGLIGIBLE * rms_step or not rms[4]:
        return 0.0
    if any(rms[1] <= factor * rms[n] for n, factor in _ROUGH.items()):
        return 0.0
    sizes = abs(differences[1])
    is_everywhere = np.mean(sizes > 0.4 * sizes.max()) > 0.05  # not a single jump
    return rms[1] / rms[4] if is_everywhere else 0.0


def _second_differences(times: Array, places: Array, n: int) -> Array:
    """Returns the accelerations through points n apart, times the square of the mean step."""
    mean_step = (times[-1] - times[0]) / (len(times) - 1)
    rates = (places[n:] - places[:-n]) / (times[n:] - times[:-n])
    differences: Array = (rates[n:] - rates[:-n]) / (times[2 * n :] - times[: -2 * n])
    differences *= 2 * mean_step**2
    return differences


def _nothing(linkage: Linkage) -> Iterator[str]:
    mechanism = linkage.mechanism
    bodies = [(link.mass, link.inertia) for link in mechanism.structure().links]
    if not any(map(any, bodies)) and not mechanism.link_loads() and not mechanism.joint_loads():
        yield 'no link has a mass or an inertia, and there is no load or friction: the torque is 0'

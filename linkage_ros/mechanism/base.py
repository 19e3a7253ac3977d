# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Base class of all mechanisms."""

import functools
import itertools
import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, cast

from linkage_ros.errors import ConfigurationError, LinkageError, MechanismError
from linkage_ros.mechanism.dyad_reach import stroke_of
from linkage_ros.mechanism.dyads import Chain, Dyad, ordered
from linkage_ros.mechanism.exact import UNITS
from linkage_ros.mechanism.kinematics import Loop, Reach, Stroke
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.loads.base import AppliedLoad, JointLoad, Load
from linkage_ros.mechanism.parts import Body, TracedPoint
from linkage_ros.mechanism.structure import Structure
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, shown

# A length in a text, m; no torque, area or speed.
_METRES = re.compile(r'(?<![\w.])(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) m(?![\w/^])')


class Description(NamedTuple):
    """A choice of coordinates for a mechanism.

    Attributes:
        coordinates: Names of the links whose positions determine all others.
        assembly: Assembly in these coordinates, 'open' or 'crossed'.
    """

    coordinates: tuple[str, ...]
    assembly: str

    def __str__(self) -> str:
        return ' '.join((*self.coordinates, self.assembly))


class Drawn(NamedTuple):
    """Names and position that a drawing gives to its mechanism.

    Attributes:
        links: Names of the links of the loop.
        points: Names of its pins, each with that in the mechanism's class, such as ('B', 'knee').
        crank_angle: Crank angle in the drawing, rad.
        position: Position of the driven link in the drawing, rad or m.
        block: Name of the link of the loop that is a block in a slot of another; empty if there
            is none, as in the loop of a cylinder.
        units: Unit of lengths in the drawing.
        cylinders: Cylinders without a load, besides the input, as springs without a force.
        fixed: Names and places, m, of the fixed pins of no link: those of springs and cylinders.
    """

    links: tuple[str, ...]
    points: tuple[tuple[str, str], ...]
    crank_angle: float
    position: float
    block: str = ''
    units: str = 'm'
    cylinders: tuple[Any, ...] = ()
    fixed: tuple[tuple[str, complex], ...] = ()


@dataclass(frozen=True)
class _FromDrawing(Checked):
    """Declares `Mechanism.drawn`."""

    drawn: Drawn | None = field(default=None, kw_only=True, metadata={'quantity': None})


class Mechanism(_FromDrawing):
    """Base class of all mechanisms.

    Mechanisms are frozen dataclasses of parts and are validated on creation.

    Attributes:
        coordinates: Names of the links whose positions determine all others.
        other_coordinates: Alternative coordinates, used where `coordinates` are singular, that is,
            at a dead centre or a stretched dyad. Empty if there are none.
        crank: The link that turns about the origin; driven, unless the structure names another.
        assembly: Assembly of the loop, 'open' or 'crossed'.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads on the links.
        dyads: Dyads that the mechanism carries, in the order in which they are solved.
        points: Traced points, sorted by name.
        drawn: Names and position of the drawing from which it was made; None without a drawing.
    """

    coordinates: ClassVar[tuple[str, ...]] = ('crank',)
    other_coordinates: ClassVar[tuple[str, ...]] = ()
    crank: Body
    assembly: str
    gravity: tuple[float, float]
    loads: Sequence[AppliedLoad] = ()
    dyads: Sequence[Dyad] = ()
    points: Sequence[TracedPoint] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.require_closed()
        except MechanismError as error:
            raise MechanismError(self.in_own_names(str(error))) from None
        if self.dyads:
            links = [link.name for link in self._named_loop.links]
            object.__setattr__(self, 'dyads', ordered(self.dyads, links))
        if self.points:
            points = sorted(self.points, key=lambda point: point.name)
            object.__setattr__(self, 'points', tuple(points))
            self.structure()  # rejects points that do not fit
        loads = tuple(load.completed() for load in _named(self.loads))
        object.__setattr__(self, 'loads', loads)

    def __repr__(self) -> str:
        kind, words = type(self).__name__, [self.assembly]
        with suppress(LinkageError):  # such as a loop that only its dyads rule out
            reach = self.reach()
            words += [reach.grashof] if reach else []
        links = ', '.join(link.name for link in self.structure().links)
        loads = f'; loads {", ".join(load.name for load in self.loads)}' if self.loads else ''
        return f'<{kind} ({", ".join(filter(None, words))}): {links}{loads}>'

    @classmethod
    def drives(cls, _values: Mapping[str, object]) -> tuple[tuple[str, ...], str]:
        """Returns the kinds of drive that the mechanism can have, and why it has no others.

        The kinds are empty if it can have all.
        """
        return (), ''

    @classmethod
    def unused(cls, _values: Mapping[str, object]) -> dict[str, str]:
        """Returns the parameters of this class that do not apply, each with the reason."""
        return {}

    def converted(self) -> 'Mechanism':
        """Returns the mechanism; a drawing, which has this method too, is converted to one."""
        return self

    def suspicion(self) -> AbstractContextManager[None]:
        """Does nothing; the same method of a drawing adds the probable cause to errors."""
        return nullcontext()

    def in_own_names(self, text: str) -> str:
        """Returns a text with the names and the unit of the drawing, if there is one.

        The given text has the names of the links in this class, and lengths in m.
        """
        if self.drawn is None:
            return text
        names = self._own_names
        named = re.sub(r'(?:\bthe )?(?<![\w-])(\w+)(?![\w-])',
                       lambda found: names.get(found[1], found[0]), text)  # fmt: skip
        return self.in_own_unit(named)

    def in_own_unit(self, text: str) -> str:
        """Returns a text with lengths in m with those in the unit of the drawing, if any."""
        unit = self.drawn.units if self.drawn else 'm'
        if unit == 'm':
            return text
        metres = float(UNITS[unit])
        return _METRES.sub(lambda found: f'{float(found[1]) / metres:.6g} {unit}', text)

    def in_own_terms(self, reach: Reach) -> Reach:
        """Returns a reach with the names and the unit of the drawing, if there is one."""
        if self.drawn is None:
            return reach
        role = 'rod' if reach.driven == 'cylinder' else reach.driven
        return reach.renamed(self._own_names[role], self.in_own_names, self.drawn.crank_angle)

    @property
    def _own_names(self) -> dict[str, str]:
        """The loop's links by their names in this class."""
        return {role: name for name, role in self._roles().items()}

    def require_closed(self) -> None:
        """Rejects lengths with which the loop cannot close."""

    def loop_structure(self) -> Structure:
        """Returns the links, points and joints of the loop."""
        raise NotImplementedError

    def structure(self) -> Structure:
        """Returns the links, points and joints of the mechanism."""
        return self._structure

    @functools.cached_property
    def _structure(self) -> Structure:
        links = functools.reduce(Structure.with_dyad, self.dyads, self._named_loop)
        return links.with_points(self.points)

    @functools.cached_property
    def _named_loop(self) -> Structure:
        loop, drawn = self.loop_structure(), self.drawn
        return loop.renamed(drawn.links, dict(drawn.points)) if drawn else loop

    def _roles(self) -> dict[str, str]:
        """Returns the names of the loop's links in this class, by their own names."""
        own = self.drawn.links if self.drawn else None
        roles = [link.name for link in self.loop_structure().links]
        return dict(zip(own or roles, roles, strict=True))

    def role_of(self, name: str) -> str:
        """Returns the name of a link of the loop in this class; '' of another link."""
        return self._roles().get(name, '')

    def parts(self) -> dict[str, Any]:
        """Returns the part of each link, with its mass and dimensions, by the link's name."""
        found = {name: getattr(self, role) for name, role in self._roles().items()}
        return found | {name: part for dyad in self.dyads for name, part in dyad.parts.items()}

    def part_groups(self) -> dict[str, str]:
        """Returns the start of the names of each part's parameters, by the link's name."""
        found = self._roles()
        for dyad in self.dyads:
            words = (f'dyads.{dyad.name}.{word}' for word in dyad.words)
            found |= dict(zip(dyad.parts, words, strict=True))
        return found

    def loop(self) -> Loop:
        """Returns the kinematic constants in the mechanism's own coordinates."""
        raise NotImplementedError

    @property
    def description(self) -> Description:
        """The mechanism's own coordinates and assembly."""
        return Description(self.coordinates, self.assembly)

    def chain(self, description: Description | None = None) -> Loop:
        """Returns the kinematic constants of loop and dyads.

        Args:
            description: Coordinates and assembly; by default, the mechanism's own.
        """
        loop = self.loop_of(description or self.description)
        if not self.dyads:
            return loop
        structure = self.structure()
        return Chain(loop, tuple(dyad.loop(structure) for dyad in self.dyads))

    def loop_of(self, description: Description) -> Loop:
        """Returns the kinematic constants of the loop in a description."""
        mechanism: Mechanism = self
        if description.assembly != self.assembly:
            mechanism = replace(cast('Any', self), assembly=description.assembly)
        is_own = description.coordinates != self.other_coordinates
        return mechanism.loop() if is_own else mechanism.other_loop()

    def other_loop(self) -> Loop:
        """Returns the kinematic constants in `other_coordinates`."""
        raise NotImplementedError

    def link_loads(self) -> dict[str, Load]:
        """Returns the loads on links by name: all but weights and `joint_loads`."""
        found = ((load.name, load.on(self)) for load in self.loads)
        return {name: load for name, load in found if load is not None}

    def joint_loads(self) -> dict[str, JointLoad]:
        """Returns the loads caused by joint forces, such as friction, by name."""
        found = ((load.name, load.in_joints(self)) for load in self.loads)
        return {name: load for name, load in found if load is not None}

    def loaded_link(self, name: str, what: str) -> int:
        """Returns the index of a link that may carry a load.

        These are the crank, the last link of the loop, and the sliders of dyads.

        Args:
            name: Name of the link.
            what: Name of the setting, for the error message.

        Raises:
            ConfigurationError: The name is not that of such a link.
        """
        structure = self.structure()
        (_, last), *added = structure.closures
        carriers = [0, last, *(j for _, j in added if structure.links[j].slides)]
        names = {structure.links[j].name: j for j in carriers}
        if name not in names:
            raise ConfigurationError(
                f'{what} = {shown(name)}: must be {" or ".join(names)} of this mechanism'
            )
        return names[name]

    def swing_middle(self, _what: str, _near: float) -> float | None:
        """Returns the middle of the output link's swing.

        Args:
            _what: Name of the setting, for the error message.
            _near: A direction of the link that the setting gives, rad. A link that swings in one
                of two circuits has a middle in each; one middle is chosen for both, so that the
                same turn of this direction is within pi of either.

        Returns:
            The direction of the link there, rad in [-pi, pi]; None for a sliding link.

        Raises:
            ConfigurationError: The link turns fully, so its swing has no middle.
        """
        return None

    def swing_side(self) -> Real | None:
        """Returns the direction opposite to one that the output link never reaches.

        Returns:
            The direction, rad in [-pi, pi]; None for a link that slides or turns fully.
        """
        return None

    def stroke(self, what: str, name: str) -> Stroke:
        """Returns the stroke of a slider, whose ends depend on the lengths alone.

        Args:
            what: Name of the setting, for the error message.
            name: Name of the link.

        Raises:
            ConfigurationError: The link is not a slider whose stroke has fixed ends.
        """
        structure = self.structure()
        last_of_dyads = [structure.links[j] for _, j in structure.closures[1:]]
        if any(link.slides and link.name == name for link in last_of_dyads):
            return stroke_of(self, what, name)
        raise ConfigurationError(
            f'{what}: {name} has no stroke with fixed ends; use a load over position, or '
            'crank_angle'
        )

    def reach(self) -> Reach | None:
        """Returns the crank's reach; None if the crank angle does not determine the motion."""
        return None

    def start(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Returns the coordinates other than the crank angle at t = 0, and their rates."""
        return (), ()


def _named(loads: Sequence[AppliedLoad]) -> list[AppliedLoad]:
    """Names loads without a name after their kind, and sorts all by name.

    Sums of loads therefore do not depend on the order in which they are given.

    Raises:
        ConfigurationError: Two loads have the same name.
    """
    named: dict[str, AppliedLoad] = {}
    for load in loads:
        if load.name in named:
            raise ConfigurationError(f'two loads have the name {shown(load.name)}: rename one')
        if load.name:
            named[load.name] = load
    kinds = {kind: name for name, kind in LOADS.items()}
    for load in loads:
        if not load.name:
            kind = kinds.get(type(load), type(load).__name__.lower())
            candidates = (f'{kind}_{n}' for n in itertools.count(1))
            name = next(x for x in candidates if x not in named)
            named[name] = replace(cast('Any', load), name=name)
    return [named[name] for name in sorted(named)]

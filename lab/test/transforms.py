# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The same machine turned as a whole, and its mirror image."""

import cmath
from dataclasses import fields, is_dataclass, replace

from linkage_ros import Force, LinkLoad, LoadCurve, SliderCrank, Solver, Spring
from linkage_ros.mechanism.dyads import DyadSlider
from linkage_ros.mechanism.parts import Frame, Guide

_SLIDERS = 'slider', 'rod'
_ACROSS = 'center', 'at', 'to_at', 'from_at', 'point'  # [along, across]
_SWAPPED = {'open': 'crossed', 'crossed': 'open'}


def _rotated(pair, angle):
    found = complex(*pair) * cmath.exp(1j * angle)
    return found.real, found.imag


def _slides(link):
    return link in _SLIDERS or link.endswith('_slider')


def turned(mechanism, angle):
    """Turns a mechanism as a whole, with gravity and loads; the crank angle grows likewise."""

    def load(one):
        if isinstance(one, LoadCurve) and (
            one.over == 'crank_angle' or (one.over == 'position' and not _slides(one.link))
        ):
            return replace(one, at=tuple(x + angle for x in one.at))
        if isinstance(one, LinkLoad) and not _slides(one.link):
            return replace(one, rest=one.rest + angle)
        if isinstance(one, Force) and one.axes == 'world':
            return replace(one, force=_rotated(one.force, angle))
        if isinstance(one, Spring) and one.to == 'frame':
            return replace(one, to_at=_rotated(one.to_at, angle))
        return one

    def dyad(one):
        changed = {
            f'{end}_at': _rotated(getattr(one, f'{end}_at'), angle)
            for end in ('from', 'to') if getattr(one, {'from': 'from_'}.get(end, end)) == 'frame'
        }  # fmt: skip
        if one.slider and one.slider.on == 'frame':
            changed['slider'] = replace(
                one.slider, at=_rotated(one.slider.at, angle), angle=one.slider.angle + angle
            )
        return replace(one, **changed)

    changed = {'frame': replace(mechanism.frame, angle=mechanism.frame.angle + angle)}
    return replace(
        mechanism, **changed, gravity=_rotated(mechanism.gravity, angle),
        loads=tuple(map(load, mechanism.loads)), dyads=tuple(map(dyad, mechanism.dyads)),
    )  # fmt: skip


def _mirror_assembly(mechanism):
    """Returns the assembly of the mirror image, which is named after the half turn from 0."""
    reach = Solver(mechanism).reach
    passes_two = reach.has_change_point and reach.period_turns == 1
    by_crank = getattr(mechanism, 'input', '') == 'crank'
    if isinstance(mechanism, SliderCrank) or by_crank or passes_two:
        return mechanism.assembly
    return _SWAPPED[mechanism.assembly]


def mirrored(mechanism):
    """Mirrors a mechanism about the x axis; crank angles and torques change their signs."""
    parts = {
        field.name: _flipped(value) for field in fields(mechanism)
        if is_dataclass(value := getattr(mechanism, field.name))
    }  # fmt: skip
    if hasattr(mechanism, 'offset'):
        parts['offset'] = -mechanism.offset
    x, y = mechanism.gravity
    return replace(
        mechanism, **parts, gravity=(x, -y), assembly=_mirror_assembly(mechanism),
        loads=tuple(map(_mirror_load, mechanism.loads)),
        dyads=tuple(map(_mirror_dyad, mechanism.dyads)),
    )  # fmt: skip


def _flipped(part):
    values = {
        name: (x, -y) for name in _ACROSS if (pair := getattr(part, name, None)) for x, y in [pair]
    }  # fmt: skip
    if isinstance(part, (Frame, Guide, DyadSlider)):
        values['angle'] = -part.angle
    if getattr(part, 'offset', None) is not None:
        values['offset'] = -part.offset
    return replace(part, **values)


def _mirror_load(load):
    if isinstance(load, Force):
        return replace(_flipped(load), force=(load.force[0], -load.force[1]))
    if isinstance(load, Spring):
        return _flipped(load)
    if isinstance(load, LinkLoad) and not _slides(load.link):
        return replace(load, force=-load.force, rest=-load.rest)
    return _mirror_curve(load) if isinstance(load, LoadCurve) else load


def _mirror_curve(curve):
    lists = {name: getattr(curve, name) for name in ('value', 'return_value', 'pressure')}
    turns = not _slides(curve.link)
    if curve.over != 'position' or turns:
        lists = {name: row and row[::-1] for name, row in lists.items()}
        lists['at'] = tuple(-x for x in reversed(curve.at))
    if turns:
        for name in ('value', 'return_value'):
            lists[name] = lists[name] and tuple(-x for x in lists[name])
        if lists['return_value']:
            lists['value'], lists['return_value'] = lists['return_value'], lists['value']
    return replace(curve, **lists)


def _mirror_dyad(dyad):
    parts = {
        name: _flipped(part) for name in ('first', 'second', 'slider', 'barrel', 'rod')
        if (part := getattr(dyad, name))
    }  # fmt: skip
    if dyad.second:
        parts['assembly'] = _SWAPPED[dyad.assembly]
    return replace(_flipped(dyad), **parts)

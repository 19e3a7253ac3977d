# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is sent to a view once: colours, names, the paths, the ground, frames of diagrams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.palette import BLACK, COLORS, GREY, color_of, mixed
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.view.axes import ASPECT, MARKS
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.scene import (
    ENERGY,
    FLOW,
    JOINT_FIELDS,
    JOINT_STATES,
    LINKAGE,
    PHASE_PLANE,
    RATES,
    angles_of,
)
from linkage_ros.view.series import ENERGIES

if TYPE_CHECKING:
    import rerun as rr

_FRONT = 32.0  # drawing order of the pins, above all lines
_THIN, _THICK, _PIN = -1.0, -3.5, -5.0  # radii; negative: points on the screen
_GRID = mixed(GREY, BLACK, 0.7)


def fixed_components(configuration: Configuration, drawing: Drawing) -> dict[str, rr.AsComponents]:
    """What is sent once: colours, names, the paths and the ground.

    Args:
        configuration: Of the run.
        drawing: The picture.

    Returns:
        Components by entity.
    """
    import rerun as rr

    lines = rr.LineStrips2D
    fixed: dict[str, rr.AsComponents] = {
        LINKAGE: rr.Transform3D(scale=[1, -1, 1]),  # y is down in Rerun's 2-D views
        f'{LINKAGE}/ground': lines(drawing.ground, colors=GREY, radii=_THIN),
        f'{LINKAGE}/pivots': rr.Points2D(
            drawing.pivots, colors=GREY, radii=_PIN, draw_order=_FRONT
        ),
        f'{LINKAGE}/pivots/names': _texts(drawing.footings.tolist(), *drawing.pivot_names),
        f'{LINKAGE}/pins': rr.Points2D.from_fields(colors=GREY, radii=_PIN, draw_order=_FRONT),
        f'{LINKAGE}/pins/names': rr.Points2D.from_fields(
            colors=GREY, radii=0.0, labels=drawing.pins, show_labels=True
        ),
        f'{LINKAGE}/scale': lines([drawing.scale], colors=GREY, radii=_THIN),
        f'{LINKAGE}/scale/length': _texts(
            [drawing.scale.mean(axis=0).tolist()], f'{drawing.scale_length:g} m'
        ),
    }
    for link, path in drawing.paths.items():
        strip = path.astype(np.float32)
        fixed[f'{LINKAGE}/paths/{link}'] = lines(strip, colors=color_of(link), radii=_THIN)
    for joint in drawing.joints:
        # The crank above the others: a coupler's triangle would hide it.
        order = _FRONT - 1 if joint == 'crank' else _FRONT - 2
        fixed[f'{LINKAGE}/{joint}'] = lines.from_fields(
            colors=color_of(joint), radii=_THICK, draw_order=order
        )
    for field in JOINT_FIELDS:
        fixed[f'{JOINT_STATES}/{field}'] = rr.SeriesLines(names=list(drawing.joints))
    fixed[RATES] = rr.SeriesLines(names=list(drawing.turning))
    for entity, names in angles_of(drawing).items():
        fixed[entity] = rr.SeriesLines(names=names)
    if isinstance(configuration.drive, TorqueDrive):
        fixed[ENERGY] = rr.SeriesLines(names=list(ENERGIES))
    if drawing.has_free_slider:
        fixed[FLOW] = rr.SeriesLines(names='flow')
        fixed.update(_phase_plane())
    return fixed


def _phase_plane() -> dict[str, rr.AsComponents]:
    """The frame of the phase plane, 1 high, and the place of its marks."""
    import rerun as rr

    marks = np.linspace(0.0, 1.0, MARKS)
    across, up = ([[[x, 0], [x, 1]] for x in marks], [[[0, y], [1, y]] for y in marks])
    names = [(0.5, -0.15), (0.0, 1.13)]
    color = COLORS['slider']
    return {
        PHASE_PLANE: rr.Transform3D(scale=[ASPECT, -1, 1]),
        f'{PHASE_PLANE}/grid': rr.LineStrips2D(across + up, colors=_GRID, radii=_THIN / 2),
        f'{PHASE_PLANE}/x': _texts([(x, -0.05) for x in marks]),
        f'{PHASE_PLANE}/y': _texts([(-0.09, y + 0.04) for y in marks]),
        f'{PHASE_PLANE}/names': _texts(names, 'position, m', 'velocity, m/s'),
        f'{PHASE_PLANE}/curve/trail': rr.LineStrips2D.from_fields(colors=color, radii=_THIN),
        f'{PHASE_PLANE}/curve/now': rr.Points2D.from_fields(
            colors=color, radii=_PIN, draw_order=_FRONT
        ),
    }


def _texts(places: Sequence[tuple[float, float]], *texts: str) -> rr.Points2D:
    """Texts in a diagram; without any, they come later."""
    import rerun as rr

    labels = texts or None
    return rr.Points2D(places, radii=0.0, colors=GREY, labels=labels, show_labels=True)

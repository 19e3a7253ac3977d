# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One colour for each link, wherever it is shown.

From the palette of Okabe and Ito, which colour-blind people can tell apart: those that stand out
from black and from white alike. A link and its curves have the same colour.
"""

from __future__ import annotations

from typing import TypeAlias

Color: TypeAlias = tuple[int, int, int]

COLORS: dict[str, Color] = {
    'crank': (213, 94, 0),
    'coupler': (0, 114, 178),
    'rocker': (0, 158, 115),
    'rod': (204, 121, 167),
    'slider': (0, 158, 115),
}
GREY: Color = (150, 150, 150)

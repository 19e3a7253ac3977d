# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Imports Matplotlib in two thirds of the time, for a program that draws a chart and ends.

The docstrings of its classes have no tables of properties then, and there are no 3-D axes. To be
imported before any other module of Matplotlib.
"""

import sys
import warnings

import matplotlib.artist

_TABLES, _AXES_3D = matplotlib.artist.kwdoc, 'mpl_toolkits.mplot3d'
matplotlib.artist.kwdoc = lambda artist: ''  # noqa: ARG005
with warnings.catch_warnings():
    warnings.simplefilter('ignore')  # that they cannot be imported
    sys.modules[_AXES_3D] = None  # type: ignore[assignment]
    import matplotlib.backends.backend_agg
    import matplotlib.figure
matplotlib.artist.kwdoc = _TABLES
del sys.modules[_AXES_3D]

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_import: reads robot models (URDF, SDF, MJCF), and finds the planar linkage in a loop."""

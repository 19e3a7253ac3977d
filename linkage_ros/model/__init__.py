# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What there is to move: descriptions, joints and bodies, exact positions, with NumPy alone.

Documents 1 to 4, which formulas refer to, are the sources in docs/mechanisms.md.
"""

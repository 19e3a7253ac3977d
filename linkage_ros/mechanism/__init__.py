# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms: parts, loads, exact poses, equations and the solver. Requires only NumPy.

References to documents 1 to 4 are to the sources listed in docs/mechanisms.md.
"""

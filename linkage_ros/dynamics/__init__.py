# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact states, torque, forces and equations of motion; needs only NumPy.

Documents 1 to 4, which formulas refer to, are the sources in docs/mechanisms.md.
"""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and validates parameters from files, presets and command lines.

The parameters of mechanisms and drives are declared in `mechanism` and `motion`, those of a run in
this package.
"""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Analyses of linkage_chart: methods, reference solutions, studies and their charts."""

__version__ = '2.0.0'

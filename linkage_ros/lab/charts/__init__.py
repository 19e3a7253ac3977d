# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the charts; the only folder that uses matplotlib."""

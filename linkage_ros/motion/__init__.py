# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion over time: exact at a given speed, integrated under a torque."""

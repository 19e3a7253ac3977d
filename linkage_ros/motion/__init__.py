# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How coordinates move in time: at a given speed, exactly, or under a torque, integrated."""

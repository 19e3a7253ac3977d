# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A configured mechanism in time: parameters, motion of the crank, steps, health."""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What motions under a torque come to: settled states, their stability, what leads to them."""

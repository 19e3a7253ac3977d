# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live node: ticks, publishers, subscribers, health, and all that uses rclpy."""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ways to solve a linkage, side by side: for the charts of speed, accuracy and stability."""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as lines, points and curves, and how these get into Rerun: the files named rerun_."""

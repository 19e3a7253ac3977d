# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands of linkage_chart do: read, compute, draw, write."""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The laboratory behind linkage_chart: methods, references, analyses and their charts."""

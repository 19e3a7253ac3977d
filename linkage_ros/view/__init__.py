# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a run in Rerun."""

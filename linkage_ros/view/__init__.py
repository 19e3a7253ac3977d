# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The view of a run: its drawing and curves, sent to Rerun by the files named rerun_."""

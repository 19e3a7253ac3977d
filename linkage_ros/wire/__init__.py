# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What goes over the wire: topics, message types, their bytes, the URDF."""

# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How large a chart and its letters are: it is read at half its size too, on 700 pixels.

No letters have less than 8 of these pixels.
"""

WIDTH, DPI = 10.0, 140  # inches, and pixels in each
TITLE, TEXT, SMALL, NUMBERS = 11.0, 10.0, 9.0, 8.5  # points

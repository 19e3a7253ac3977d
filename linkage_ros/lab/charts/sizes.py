# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sizes of charts and their text, which must be readable at a width of 700 pixels, half size.

No text is smaller than 8 of these pixels.
"""

WIDTH, DPI = 10.0, 140  # inches, and pixels in each
TITLE, TEXT, SMALL, NUMBERS = 11.0, 10.0, 9.0, 8.5  # points

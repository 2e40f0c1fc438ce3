"""The colors of all pictures, which the color-blind can tell apart: Okabe and Ito (2008), and some grays."""

from typing import Final

BLUE: Final = "#0072B2"
RED: Final = "#D55E00"
GREEN: Final = "#009E73"
PINK: Final = "#CC79A7"
ORANGE: Final = "#E69F00"
DARK: Final = "#222222"
GRAY: Final = "#777777"
SHADE: Final = "#f3cf86"
"""The color of areas behind marks."""

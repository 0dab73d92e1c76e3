"""The diagram along a line through the point, as the page is sent it."""

from __future__ import annotations

import numpy as np

from vibroimpact.explorer.line import Line
from vibroimpact.explorer.parcel import Parcel
from vibroimpact.explorer.state import View, parameter_label
from vibroimpact.plotting.style import BLUE


class LineView:
    """Impact velocities along a line through the point."""

    def __init__(self) -> None:
        self.parcels = {"line": Parcel("line")}

    def show_view(self, view: View, parcel: Parcel) -> None:
        """Put range and label where the view has them."""
        parameter, ends = view.along
        parcel.pack("line_home", x=ends, label=parameter_label(parameter))
        parcel.pack("line", here=getattr(view.osc, parameter), color=BLUE)

    def show(self, line: Line) -> None:
        """Draw a diagram."""
        most = float(line.velocities.max(initial=0.0)) or 1.0
        parcel = self.parcels["line"]
        low, high = line.ends
        dots = np.concatenate([(line.values - low) / (high - low), line.velocities])  # each array costs two messages
        parcel.pack("line", low=low, high=high, dots=dots.astype(np.float32))
        parcel.pack("line_home", y=(-0.02 * most, 1.05 * most))
        parcel.send()

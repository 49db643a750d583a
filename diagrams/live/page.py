"""The page of a live session: Meshcat's sliders, buttons, gamepad and scene."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.common.live import Figure, Guided, Slider
from systems.common.signal import flat

DEAD = 0.15
"""Of a gamepad's stick: what is less is rest."""
SWEEP = 2.5
"""In which a stick moves a slider from end to end [s]."""
OTHER = 5
"""Button of a gamepad that, held, moves what is guided second."""
AXES = ((0, 1.0), (1, -1.0), (3, -1.0))
"""Of a gamepad, for x, y and z, and which way is more."""


class Page:
    """Controls and read-outs of a session in Meshcat.

    Attributes:
        meshcat: The Meshcat.
    """

    def __init__(self, meshcat: Any) -> None:
        """Takes over a Meshcat."""
        self.meshcat = meshcat
        self._clicks: dict[str, int] = {}
        self._figures: list[Figure] = []
        self._guided: list[Guided] = []
        self._words = ""

    def lay_out(
        self,
        guided: Sequence[Guided],
        buttons: Sequence[str],
        figures: Sequence[Figure],
    ) -> None:
        """Makes the controls anew, in this order."""
        meshcat = self.meshcat
        for name in meshcat.GetSliderNames():
            meshcat.DeleteSlider(name)
        for name in meshcat.GetButtonNames():
            meshcat.DeleteButton(name)
        self._guided, self._figures, self._words = [*guided], [*figures], ""
        for name in buttons:
            meshcat.AddButton(name, "Space" if name == "pause" else "")
        self._clicks = dict.fromkeys(buttons, 0)
        for figure in figures:
            meshcat.AddSlider(
                f"> {figure.label}", figure.low, figure.high, figure.step, figure.low
            )
        for one in guided:
            for slider, value in zip(one.sliders, flat(one.rest), strict=True):
                shown = slider.per_SI * float(value)
                scale = (slider.low, slider.high, slider.step, shown)
                meshcat.AddSlider(slider.label, *scale, *slider.keys)

    def clicked(self) -> list[str]:
        """Buttons that were pressed since this was asked last."""
        found = []
        for name, before in self._clicks.items():
            now = self.meshcat.GetButtonClicks(name)
            self._clicks[name] = now
            found += [name] * (now != before)
        return found

    def wanted(self, one: Guided) -> np.ndarray:
        """Where the sliders of what is guided are, in SI units."""
        values = [self.meshcat.GetSliderValue(s.label) / s.per_SI for s in one.sliders]
        return np.array(values)

    def put(self, one: Guided, value: Any) -> None:
        """Moves the sliders of what is guided."""
        for slider, element in zip(one.sliders, flat(value), strict=True):
            self._put(slider, slider.per_SI * float(element))

    def _put(self, slider: Slider, shown: float) -> None:
        within = min(max(shown, slider.low), slider.high)
        self.meshcat.SetSliderValue(slider.label, within)

    def move_by_gamepad(self, elapsed: float) -> None:
        """Moves sliders as the sticks are held, for `elapsed` seconds."""
        pad = self.meshcat.GetGamepad()
        held = [one for one in self._guided if one.sliders]
        if pad.index is None or not held:
            return
        is_other = len(pad.button_values) > OTHER and pad.button_values[OTHER] > 0.5
        one = held[is_other and len(held) > 1]
        for slider, (axis, way) in zip(one.sliders, AXES, strict=False):
            stick = pad.axes[axis] if axis < len(pad.axes) else 0.0
            if abs(stick) > DEAD:
                step = way * stick * (slider.high - slider.low) * elapsed / SWEEP
                self._put(slider, self.meshcat.GetSliderValue(slider.label) + step)

    def show(self, values: Sequence[float], words: str) -> None:
        """Shows figures, in SI units, and words."""
        for figure, value in zip(self._figures, values, strict=True):
            shown = float(np.nan_to_num(figure.per_SI * value, nan=figure.low))
            shown = min(max(shown, figure.low), figure.high)
            self.meshcat.SetSliderValue(f"> {figure.label}", shown)
        if words != self._words:
            if self._words:
                self.meshcat.DeleteButton(self._words)
            if words:
                self.meshcat.AddButton(words)
            self._words = words

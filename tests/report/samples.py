"""Small reports with known content."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stratalux.report.model import Chart, Claim, Crop, Curve, HeatMap, ImageSet, Picture, Report, Section, Table

WIDTH, HEIGHT = 60, 40
NASTY = 'a < b & "c" </script><!-- \\ $style'
"""Text that must come out as it is, wherever it stands."""


def ramp(gain: float = 1.0) -> NDArray[np.float32]:
    """Pixel (x, y) has the radiance ``gain`` times (x + 1, y + 1, 0.25), over 32."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return (np.stack([x + 1, y + 1, np.full_like(x, 8)], axis=-1) / 32 * gain).astype(np.float32)


def image_set(title: str = "Ramps") -> ImageSet:
    """Three pictures and a reference; the second equals it, the first is twice as bright. Exposure −1."""
    flip = np.zeros((HEIGHT, WIDTH), dtype=np.float32)
    flip[10, 20] = 1.0
    return ImageSet(
        title,
        (
            Picture("double", ramp(2), {"relMSE": "1.0"}, flip),
            Picture("same", ramp()),
            Picture("half", ramp(0.5), {"relMSE": "0.25"}),
        ),
        reference=Picture("truth", ramp(), {"spp": "4096"}),
        exposure=-1.0,
        crops=(Crop("corner", 40, 20, 60, 40),),
        text="Some ramps.",
    )


def chart(**changes: object) -> Chart:
    curves = (
        Curve("stratified", ((16, 0.1, 0.08, 0.12), (64, 0.02, 0.015, 0.03), (256, 0.004, 0.003, 0.005))),
        Curve("direct", ((16, 0.4, 0.4, 0.4), (64, 0.1, 0.1, 0.1))),
        Curve("lights", ((16, 0.05, 0.05, 0.05),), dashed=True),
    )
    fields: dict[str, object] = {
        "title": "Errors",
        "x_label": "rays",
        "y_label": "relMSE",
        "curves": curves,
        "floor": (1e-3, "noise"),
        "text": "How they fall.",
    }
    return Chart(**(fields | changes))  # type: ignore[arg-type]


def heat_map() -> HeatMap:
    values = np.array([[1.0, 4.0, np.nan], [0.5, 2.0, 8.0]])
    return HeatMap("Times", "strata", "proposals", ("16", "64", "256"), ("1", "4"), values, unit="s")


def table() -> Table:
    return Table("Figures", ("name", "relMSE"), (("direct", "0.4"), ("stratified", "0.02"), ("lights", "0.1 *")))


def report(*, images: tuple[ImageSet, ...] | None = None) -> Report:
    claims = (
        Claim("It is faster.", "4 times", "3.6 times", "holds"),
        Claim("It is short.", "100 lines", "180 lines", "partly", "Comments count."),
        Claim("It is unbiased.", "yes", "yes", "holds"),
        Claim("It is never slower.", "yes", "no", "fails"),
        Claim("It runs on a card.", "25 fps", "–", "not tested"),
    )
    blocks = (chart(), heat_map(), table())
    return Report(
        "A report",
        "of nothing in particular",
        ("All is well.",),
        (
            Section("claims", "Claims", ("As they say.",), claims, blocks),
            Section("pictures", "Pictures", blocks=(image_set(),) if images is None else images),
        ),
        {"machine": "a small one"},
        ("Take care.",),
    )

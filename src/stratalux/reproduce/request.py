"""What is reproduced, and where it finds and leaves things."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import Settings, option


@dataclass(frozen=True)
class ReproductionSettings(Settings):
    """What is reproduced, and where it finds and leaves things."""

    items: tuple[str, ...] = option(
        (),
        "Figures and numbers of the paper, all without any.",
        argument=True,
        several=True,
        metavar="[fig1 fig2 fig3 fig4 fig5 timings | all]",
    )
    quick: bool = option(False, "Small images and few samples: two minutes in place of most of an hour.", "--quick")
    folder: str = option("reproduction", "Folder to write.", "-o", "--output", metavar="FOLDER")
    assets: str | None = option(
        None, "Folder of the paper's map and meshes.", "--assets", metavar="DIR", default_text="$STRATALUX_ASSETS"
    )
    force: bool = option(False, "Compute everything anew, in place of going on with a former run.", "--force")

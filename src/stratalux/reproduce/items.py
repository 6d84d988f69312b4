"""All items of the reproduction, by name, in the order of the paper."""

from __future__ import annotations

from . import figure1, figure2, figure3, figure4, figure5, timings
from .item import Item

ITEMS: dict[str, Item] = {
    item.name: item for item in (figure1.ITEM, figure2.ITEM, figure3.ITEM, figure4.ITEM, figure5.ITEM, timings.ITEM)
}

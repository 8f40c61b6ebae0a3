"""Contact sheets: pictures in aligned columns under headings, on a dark ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

GROUND = (27, 27, 31)
PANEL = (33, 33, 38)
HEADING = (236, 234, 228)
CAPTION = (164, 162, 158)
RULE = (62, 62, 70)
MARGIN, GAP, CAPTION_HEIGHT, HEADING_HEIGHT, TITLE_HEIGHT = 36, 8, 24, 58, 84


@dataclass(frozen=True)
class Cell:
    """A picture (h, w, 3) uint8 with a caption beneath it."""

    image: np.ndarray
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """A heading, a note or a legend (h, w, 3) beside it, and rows of cells; cells of a row share a height."""

    heading: str
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    legend: np.ndarray | None = None


def compose_sheet(title, subtitle, sections):
    """The sheet as (h, w, 3) uint8: as wide as its widest row."""
    widest = max(_row_width(row) for section in sections for row in section.rows)
    width = widest + 2 * MARGIN
    height = TITLE_HEIGHT + sum(_section_height(section) for section in sections) + MARGIN
    sheet = Image.new("RGB", (width, height), GROUND)
    draw = ImageDraw.Draw(sheet)
    draw.text((MARGIN, 24), title, HEADING, ImageFont.load_default(30))
    draw.text((width - MARGIN, 36), subtitle, CAPTION, ImageFont.load_default(15), anchor="ra")
    top = TITLE_HEIGHT
    for section in sections:
        _draw_section(sheet, draw, section, top, width)
        top += _section_height(section)
    return np.asarray(sheet)


def _draw_section(sheet, draw, section, top, width):
    draw.line([(MARGIN, top + 6), (width - MARGIN, top + 6)], RULE)
    draw.text((MARGIN, top + 18), section.heading, HEADING, ImageFont.load_default(20))
    if section.note:
        right = width - MARGIN - (0 if section.legend is None else section.legend.shape[1] + 2 * GAP)
        draw.text((right, top + 22), section.note, CAPTION, ImageFont.load_default(14), anchor="ra")
    if section.legend is not None:
        sheet.paste(Image.fromarray(section.legend), (width - MARGIN - section.legend.shape[1], top + 16))
    y = top + HEADING_HEIGHT
    for row in section.rows:
        x = MARGIN
        for cell in row:
            cell_height, cell_width = cell.image.shape[:2]
            sheet.paste(Image.fromarray(np.ascontiguousarray(cell.image)), (x, y))
            if cell.caption:
                center = (x + cell_width // 2, y + cell_height + 4)
                draw.text(center, cell.caption, CAPTION, ImageFont.load_default(13), anchor="ma")
            x += cell_width + GAP
        y += _row_height(row)


def _row_width(row):
    return sum(cell.image.shape[1] for cell in row) + GAP * (len(row) - 1)


def _row_height(row):
    caption = CAPTION_HEIGHT if any(cell.caption for cell in row) else 0
    return max(cell.image.shape[0] for cell in row) + caption + GAP


def _section_height(section):
    return HEADING_HEIGHT + sum(_row_height(row) for row in section.rows) + GAP


def color_bar(colors, labels, size=(12, 360)):
    """A horizontal scale (h, w, 3) of colours (k, 3) uint8 with labels spread beneath it."""
    height, width = size
    bar = Image.new("RGB", (width, height + 20), GROUND)
    places = np.linspace(0, len(colors) - 1, width).round().astype(int)
    bar.paste(Image.fromarray(np.broadcast_to(colors[places], (height, width, 3)).copy()), (0, 0))
    draw = ImageDraw.Draw(bar)
    for i, label in enumerate(labels):
        anchor = "la" if i == 0 else "ra" if i == len(labels) - 1 else "ma"
        x = round(i * (width - 1) / (len(labels) - 1))
        draw.text((x, height + 3), label, CAPTION, ImageFont.load_default(13), anchor=anchor)
    return np.asarray(bar)

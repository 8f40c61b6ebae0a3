"""Rows of figures beside their bars: what `facewright evaluate rig` and the benchmarks print."""

from __future__ import annotations

from dataclasses import dataclass

_UNBOUND = (None, None)


@dataclass(frozen=True)
class Row:
    """One figure of a rig.

    group, pose, figure  what was measured, where, and its name with its unit
    full, plain  the rig with in-betweens and correctives, and as the plain 52 (None: the same, or not asked)
    bar          (least, most) of full, None: unbound; plain_bar of plain
    """

    group: str
    pose: str
    figure: str
    full: float | None
    plain: float | None = None
    bar: tuple[float | None, float | None] = _UNBOUND
    plain_bar: tuple[float | None, float | None] = _UNBOUND

    @property
    def has_bar(self):
        return self.bar != _UNBOUND or self.plain_bar != _UNBOUND

    @property
    def met(self):
        """Whether every bar is met; a figure that could not be taken meets none."""
        return _within(self.full, self.bar) and _within(self.plain, self.plain_bar)

    def worse(self, other):
        """The worse of two rows of the same figure: farther outside its bar, or less inside it."""
        return self if _badness(self) >= _badness(other) else other


def worst_rows(tables):
    """From lists of rows of several heads: the worst of each figure, and on how many heads it is met.

    tables   dict head -> list of Row
    returns  list of (Row, head, met, heads)
    """
    found = {}
    for head, rows in tables.items():
        for row in rows:
            key = (row.group, row.pose, row.figure)
            worst, where, met, count = found.get(key, (row, head, 0, 0))
            if row.worse(worst) is row and row is not worst:
                worst, where = row, head
            found[key] = (worst, where, met + row.met, count + 1)
    return list(found.values())


def _within(value, bar):
    least, most = bar
    if bar == _UNBOUND:
        return True
    if value is None:
        return False
    return (least is None or value >= least) and (most is None or value <= most)


def _badness(row):
    """Larger is worse: how far outside the bars, in shares of them; without a bar the figure itself."""
    found = [_beyond(row.full, row.bar), _beyond(row.plain, row.plain_bar)]
    found = [value for value in found if value is not None]
    return max(found) if found else abs(row.full or 0.0)


def _beyond(value, bar):
    if bar == _UNBOUND:
        return None
    if value is None:
        return float("inf")
    least, most = bar
    over = [] if most is None else [(value - most) / max(abs(most), 1.0)]
    return max([*over, *([] if least is None else [(least - value) / max(abs(least), 1.0)])])

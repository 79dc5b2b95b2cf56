"""How a measurement file is written, as the keys of ``measurements.file`` have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

TABLE, FEATURES, SPHERICAL = "table", "features", "spherical"
ENCODINGS = ("utf-8", "utf-16-le", "utf-16-be", "latin-1", "cp932")


@dataclass(frozen=True)
class Directions:
    """How a spherical reading states its angles; ``unit`` deg, gon or rad.

    ``vertical`` is counted from the zenith or from the horizon; ``horizontal`` is clockwise or
    counterclockwise, seen from above.
    """

    unit: str = "deg"
    vertical: str = "zenith"
    horizontal: str = "clockwise"


@dataclass(frozen=True)
class Written:
    """How a file is written; what is not given is as most programs write.

    ``delimiter`` may be ``blanks``, one or more of them. ``thousands`` is the mark between
    thousands, None for none. ``names`` are the columns of a file that has no line of names;
    ``layout`` is table, features (a row per feature and axis) or spherical.
    """

    delimiter: str = ","
    decimal: str = "."
    thousands: str | None = None
    skip_lines: int = 0
    skip_under_names: int = 0
    encoding: str = "utf-8"
    sheet: str | None = None
    names: tuple[str, ...] | None = None
    layout: str = TABLE
    directions: Directions = Directions()

    @classmethod
    def of(cls, section: Mapping) -> Written:
        """As a section ``measurements.file`` says; a key that is not there is at its default."""
        given = {each.name: section[each.name] for each in fields(cls) if each.name in section}
        if given.get("names") is not None:
            given["names"] = tuple(given["names"])
        if "directions" in given:
            given["directions"] = Directions(**given["directions"])
        return cls(**given)

    def section(self) -> dict[str, object]:
        """The keys of ``measurements.file`` that say so, defaults included."""
        keys = asdict(self)
        return keys | {"names": None if self.names is None else list(self.names)}

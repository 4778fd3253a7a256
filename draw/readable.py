"""Numbers as people read them: as many digits as the quantity bears, nothing rounded to nothing, no powers of ten."""

import math
from string import Formatter
from typing import Any, TypeGuard

GAP = "\u202f"
"""Between a large number's thousands: narrow, not broken."""
MOST_PERCENT = 999


def is_number(value: Any) -> TypeGuard[float]:
    """Tell whether the value can be shown as a number: not None, not NaN, not infinite."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def readable(value: float, decimals: int = 2) -> str:
    """Return a number with so many decimals: fewer from 100 on, two more where it would be rounded to nothing."""
    size = abs(value)
    if size >= 10_000 or isinstance(value, int):
        return f"{value:,.0f}".replace(",", GAP) if size >= 10_000 else str(value)
    shown = f"{value + 0.0:.{min(decimals, 0 if size >= 1000 else 1 if size >= 100 else decimals)}f}"
    if value and not float(shown):
        # 0.003 must not be shown as 0.00.
        more = next((n for n in (decimals + 1, decimals + 2) if float(f"{value:.{n}f}")), 0)
        least = f"{10.0 ** -(decimals + 2):.{decimals + 2}f}"
        shown = f"{value:.{more}f}" if more else f"under {least}" if value > 0 else f"over -{least}"
    return shown


def share(value: float, decimals: int = 0) -> str:
    """Return a share, 1 for all, as percentage without its sign: neither a few pixels are none, nor most of them all.

    Beyond three digits nobody asks how many.
    """
    if abs(value) * 100 > MOST_PERCENT:
        return f"over {MOST_PERCENT}" if value > 0 else f"under -{MOST_PERCENT}"
    shown = f"{100 * value:.{decimals}f}"
    if (value and not float(shown)) or (value < 1 and float(shown) == 100):
        ends = {"over 99.9": value > 0.9995, "under 0.1": 0 < value < 0.0005}
        shown = next((words for words, is_so in ends.items() if is_so), f"{100 * value:.1f}")
    return shown


class Readable(Formatter):
    """Fills in forms: {x:2px} by `readable` with its unit, {x:1%} by `share`, {x:g} as somebody stated it.

    Raises LookupError where a value is missing, None or no number.
    """

    def format_field(self, value: Any, format_spec: str) -> str:
        decimals, unit = format_spec[:1], format_spec[1:]
        if isinstance(value, str | list | tuple):
            return self.words(value if isinstance(value, str) else "; ".join(map(str, value)))
        if not is_number(value):
            return self.missing()
        if decimals == "g":
            return self.number(value, f"{value:g}", unit)
        by = share if unit == "%" else readable
        return self.number(value, by(value, int(decimals or 0)), unit)

    def words(self, text: str) -> str:
        return text

    def missing(self) -> str:
        raise LookupError("a value is not known")

    def number(self, value: float, shown: str, unit: str) -> str:
        """Return a number and its unit, a gap between them where there is one."""
        return f"{shown}{'' if unit in {'', '°'} else ' '}{unit}"

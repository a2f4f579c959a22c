"""How large a saved comparison may be: what is read back within bounds is all that is written.

JSON takes many times its own size once it is read, of lists, names and short numbers; so these are counted. A page
of 20 000 steps and 65 rows takes 80 MB and 15 million numbers.
"""

from hevopt.errors import DataError
from hevopt.pages.comparison.results import SavedTrace
from hevopt.pages.comparison.saved_car import CarFigures, Number

# Unpacked.
MEGABYTES_MAX = 200
_VALUES_MAX, _LISTS_MAX, _TEXTS_MAX = 20_000_000, 2_000_000, 4_000_000
_PER_CAR = sum(of.annotation == list[Number] for of in CarFigures.model_fields.values())


def check_room(place: object, text: bytes, advice: str) -> None:
    """DataError where the JSON of a comparison is more than may be read back; advice: what to do."""
    counted = (
        ("bytes", len(text), MEGABYTES_MAX * 1_000_000),
        ("values", text.count(b","), _VALUES_MAX),
        ("lists and tables", text.count(b"[") + text.count(b"{"), _LISTS_MAX),
        ("texts", text.count(b'"') // 2, _TEXTS_MAX),
    )
    for what, count, most in counted:
        if count > most:
            raise DataError(f"{place}: {count} {what}; allowed: up to {most}; {advice}")


def check_planned(steps: int, cars: int, rows: int) -> None:
    """DataError where so many cars and rows over so many steps cannot be saved."""
    per_row = len(SavedTrace.model_fields)
    count = steps * (rows * per_row + cars * _PER_CAR)
    if count > _VALUES_MAX:
        most = max((_VALUES_MAX // steps - cars * _PER_CAR) // per_row, 0)
        raise DataError(
            f"{rows} rows of {steps} steps are {count / 1e6:.0f} million values; allowed for --report and --save: "
            f"up to {_VALUES_MAX / 1e6:.0f} million, here {most} rows; ask for fewer cars or strategies, or a "
            "shorter cycle"
        )

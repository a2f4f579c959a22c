"""Names of months as phones and spreadsheets write them in a date, whole or cut short."""

import unicodedata
from functools import cache

_NAMES = {
    "English": "january february march april may june july august september october november december",
    "German": "januar februar märz april mai juni juli august september oktober november dezember",
    "Austrian": "jänner feber märz april mai juni juli august september oktober november dezember",
    "French": "janvier février mars avril mai juin juillet août septembre octobre novembre décembre",
    "Italian": "gennaio febbraio marzo aprile maggio giugno luglio agosto settembre ottobre novembre dicembre",
    "Spanish": "enero febrero marzo abril mayo junio julio agosto septiembre octubre noviembre diciembre",
    "Portuguese": "janeiro fevereiro março abril maio junho julho agosto setembro outubro novembro dezembro",
    "Dutch": "januari februari maart april mei juni juli augustus september oktober november december",
    "Polish": "stycznia lutego marca kwietnia maja czerwca lipca sierpnia września października listopada grudnia",
    "Swedish": "januari februari mars april maj juni juli augusti september oktober november december",
    "Danish": "januar februar marts april maj juni juli august september oktober november december",
    "Norwegian": "januar februar mars april mai juni juli august september oktober november desember",
}
# Short forms that are no beginning of the whole name.
_SHORT = {"mrt": 3, "mrz": 3}
_LETTERS_MIN = 3


def _plain(name: str) -> str:
    parts = unicodedata.normalize("NFKD", name.casefold())
    return "".join(letter for letter in parts if not unicodedata.combining(letter))


@cache
def month_of(name: str) -> int:
    """1 to 12, 0 where a name is none of a month, or of two."""
    name = _plain(name)
    if name in _SHORT:
        return _SHORT[name]
    if len(name) < _LETTERS_MIN:
        return 0
    fits = {
        month
        for names in _NAMES.values()
        for month, whole in enumerate(names.split(), start=1)
        if _plain(whole).startswith(name)
    }
    return fits.pop() if len(fits) == 1 else 0

"""Words of the trade that a page explains where they stand: by a title, at their first place in a text."""

import re

from markupsafe import Markup, escape

from hevopt.bounds.claim import PROOF_WORDS

WORDS = {
    "tabulated controls": "the torques, gears and clutches that the table of the car lists for each step, "
    "by default 41 torques for each gear and machine",
    "charge-corrected": "fuel less what stored energy beyond that asked at the end is worth",
    "proven lower bound": "a figure that no plan can undercut, whatever the strategy; over which controls is told",
    **{str(proof): f"a bound by {words}" for proof, words in PROOF_WORDS.items()},
    "causal": "decides without knowing the rest of the cycle",
}
_ANY = re.compile("|".join(rf"\b{re.escape(word)}\b" for word in WORDS))


def explained(text: str) -> Markup:
    """The text, escaped, with what each of these words means as its title, where it first stands."""
    parts, at = [], 0
    seen: set[str] = set()
    for match in _ANY.finditer(text):
        word = match.group()
        if word in seen:
            continue
        seen.add(word)
        parts.append(escape(text[at : match.start()]))
        parts.append(Markup('<abbr class="word" title="{}">{}</abbr>').format(WORDS[word], word))
        at = match.end()
    return Markup("").join([*parts, escape(text[at:])])

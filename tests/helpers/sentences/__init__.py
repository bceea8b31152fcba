"""What each sentence, verdict and cell of a first screen means: rules that compare it with the numbers of the file.

`first_line`, `understood`, `cells`, `statements` and `remedies` have the rules of that part of every screen, the other
files those of the lines and tables of an analysis; `values` has what they share.
"""

from __future__ import annotations

import re
from importlib import import_module

from tests.helpers.screens import RULES, ResultFacts, read_screen
from tests.helpers.sentences.first_line import wrong_first_line
from tests.helpers.sentences.remedies import wrong_remedies
from tests.helpers.sentences.studies import other_cell, responses_called
from tests.helpers.sentences.values import called_name, compared_text

FILES = (
    "first_line", "cells", "continuations", "coexisting", "modes", "runs_and_sweeps", "statics", "studies",
    "identification", "understood", "statements",
)  # fmt: skip
for name in FILES:
    import_module(f"{__name__}.{name}")
# of the rules that match a text the first one counts, whichever file was imported first
RULES.sort(key=lambda each: FILES.index(each.check.__module__.rpartition(".")[2]))


def contradictions(text: str, facts: ResultFacts) -> list[str]:
    """What a screen says that its file does not, and what no rule knows.

    Parameters
    ----------
    text : as it was printed on standard output.
    facts : of the result file.
    """
    screen = read_screen(text, facts, lambda text: is_heading(facts, text))
    found = []
    for row in screen.rows:
        name, cells = (row[0], row[1:]) if screen.header[0] == "" else ("", row)
        for heading, content in zip(screen.header[-len(cells) :], cells, strict=True):
            if content not in ("-", ""):
                found += [f"{name}, {heading}: {each}" for each in _cell(facts, heading, name, content)]
    for line in screen.lines:
        found += compared_text("line", line, facts)
    for text in screen.statements:  # without a table sentences stand there
        found += compared_text("statement" if screen.header or text[:1].isupper() else "line", text, facts)
    for part in re.split(r"; (?!\d)", screen.understood) if screen.understood else ():
        found += compared_text("understood", part, facts)
    found += wrong_first_line(screen, facts)
    found += compared_text("foot", screen.foot, facts)
    return [*found, *wrong_remedies(text, facts)]


def is_heading(facts: ResultFacts, text: str) -> bool:
    """Whether a text is the heading of a column: those of studies are of parameters, objectives and responses too."""
    if any(each.where == "heading" and each.pattern.fullmatch(text) for each in RULES):
        return True
    if facts.kind != "designs":
        return False
    objectives = [name.replace("_", " ") for name in facts.labels("cases/objective")]
    parameters = [called_name(path) for path in facts.labels("cases/parameter")]
    return text in (*parameters, *objectives) or bool(responses_called(facts, text))


def _cell(facts: ResultFacts, heading: str, name: str, text: str) -> list[str]:
    """Contradictions of a cell."""
    dynamic = facts.kind == "designs" and not re.fullmatch(OF_STUDIES, heading)
    if dynamic:
        return list(other_cell(facts, heading, name, text))
    return compared_text("heading", heading, facts, name, text)


OF_STUDIES = (
    r"(?:smallest|largest)(?: \(at .*\))?|mean|median|5 %|95 %|margin|worst|limit|deviation|design point|"
    r"importance \(%\)|doubles.*"
)

"""Words and tables in LaTeX, no wider than the text of a page or a slide."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

NEEDS = "% In the preamble: \\usepackage{booktabs}"

_SIGNS = {
    "\\": r"\textbackslash{}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    **{sign: f"${sign}$" for sign in "<>|"},
    # Bare, they would be arguments of the end of the line before.
    **{sign: f"{{{sign}}}" for sign in "[*"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    '"': "''",
    "±": r"$\pm$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "≈": r"$\approx$",
    "→": r"$\to$",
    "−": "$-$",
    "Δ": r"$\Delta$",
    "²": "$^2$",
    "³": "$^3$",
}
# Of a number such as -2.0e-05 or < 2.0e-05.
_POWER = re.compile(r"(?<![\w.])(< )?(-?\d+(?:\.\d+)?)e([+-]?\d+)(?!\w|\.\d)")
_MINUS = re.compile(r"(?<![\w.)\]-])-(?=\d)")
# Inside a group. A slide of beamer is the narrowest; its small letters have 10 points.
SMALL = r"\small\setlength{\tabcolsep}{3pt}\medmuskip=1mu"
_WIDEST, _LONG, _BETWEEN = 304.0, 130.0, 6.0
# In points of such letters. The widest of all is m.
_LETTER, _NARROW, _WIDE = 5.1, 3.4, 8.0
_LESS, _TIMES_TEN, _RAISED, _RAISED_MINUS = 13.4, 19.0, 4.0, 6.6
_HEADER_LETTERS, _CELL_LETTERS = 12, 24


def text(words: str) -> str:
    """Words in which no letter has a meaning for LaTeX, and numbers as powers of ten."""
    parts, end = [], 0
    for number in _POWER.finditer(words):
        parts.append(_escaped(words[end : number.start()]))
        less, digits, power = number.groups(default="")
        parts.append(rf"${less}{digits} \times 10^{{{int(power)}}}$")
        end = number.end()
    return "".join([*parts, _escaped(words[end:])])


def tabulars(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    left: Collection[int],
    long: Collection[int] = (),
    rules: Collection[int] = (),
) -> list[str]:
    """A table in as many pieces as its width needs; each repeats the first column.

    Arguments:
        headers: of the columns, as plain words.
        rows: cells, as plain words.
        left: the columns whose text is flush left.
        long: the columns whose text may be broken into lines.
        rules: the rows above which there is a line.
    """
    heads = [_lines(header, _HEADER_LETTERS) for header in headers]
    cells = [
        [
            _lines(cell, _CELL_LETTERS) if _width(cell) > _LONG and column not in long else [cell]
            for column, cell in enumerate(row)
        ]
        for row in rows
    ]
    widths = [
        max(_width(words) for row in [heads, *cells] for words in row[column])
        for column in range(len(headers))
    ]
    widths = [min(w, _LONG) if column in long else w for column, w in enumerate(widths)]

    pieces: list[list[int]] = [[0]]
    for column in range(1, len(headers)):
        width = widths[column] + sum(widths[each] + _BETWEEN for each in pieces[-1])
        if width > _WIDEST and len(pieces[-1]) > 1:
            pieces.append([0])
        pieces[-1].append(column)

    def kind(column: int) -> str:
        if column in long and widths[column] == _LONG:
            return f"p{{{_LONG:g}pt}}"
        return "l" if column in left else "r"

    def line(row: Sequence[Sequence[str]], columns: list[int]) -> str:
        sides = ("l" if column in left else "r" for column in columns)
        written = (_stack(row[column], side) for column, side in zip(columns, sides, strict=True))
        return " & ".join(written) + r" \\"

    def lines(columns: list[int]) -> list[str]:
        body = []
        for index, row in enumerate(cells):
            body += [r"\midrule"] * (index in rules)
            body.append(line(row, columns))
        return [
            rf"\begin{{tabular}}{{@{{}}{''.join(map(kind, columns))}@{{}}}}",
            r"\toprule",
            line(heads, columns),
            r"\midrule",
            *body,
            r"\bottomrule",
            r"\end{tabular}",
        ]

    return ["\n".join(lines(columns)) for columns in pieces]


def _escaped(words: str) -> str:
    marked = _MINUS.sub("−", words)
    signs = "".join(_SIGNS.get(sign, sign) for sign in marked)
    return signs.replace(r"$\Delta$t", r"$\Delta t$")


def _width(words: str) -> float:
    """Of a cell, in points."""
    letters = _POWER.sub(lambda number: number[2], words)
    width = sum(
        _NARROW if each in " .,:;-|ijlftr[]()'" else _WIDE if each in "mwMW%" else _LETTER
        for each in letters
    )
    for less, _, power in _POWER.findall(words):
        raised = str(int(power))
        width += _LESS * bool(less) + _TIMES_TEN + _RAISED * len(raised.lstrip("-"))
        width += _RAISED_MINUS * raised.startswith("-")
    return width


def _stack(lines: Sequence[str], side: str) -> str:
    words = r"\\".join(map(text, lines))
    return rf"\shortstack[{side}]{{{words}}}" if len(lines) > 1 else words


def _lines(words: str, letters: int) -> list[str]:
    """The lines of a header or a long name, broken behind hyphens and the like."""
    lines = [""]
    for part in re.findall(r"[^\s\-:,_=/.]*[\s\-:,_=/.]*", words):
        if part and lines[-1] and len(lines[-1]) + len(part.rstrip()) > letters:
            lines.append("")
        lines[-1] += part
    return [line.strip() for line in lines if line.strip()]

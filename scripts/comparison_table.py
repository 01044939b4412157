"""The tables of a comparison with Mitsuba, as Markdown."""

import math
from typing import Any


def figure(x: float) -> str:
    """Two digits, or all before the point, without exponents."""
    return f"{x:.{max(1 - math.floor(math.log10(x)), 0)}f}" if x > 0 else "0"


def bounded(word: str, is_bound: bool, x: float) -> str:
    return f"{word} {figure(x)}" if is_bound else figure(x)


def table(comparison: dict[str, Any]) -> str:
    """Seconds to each error, then how far the pictures agree."""
    others = ("mitsuba", "path")
    lines = ["| scene | relMSE | Mitsuba `path` | Dualight `path` | Dualight, by default | faster than Mitsuba"
             " | faster than `path` |", "|---|---:|---:|---:|---:|---:|---:|"]
    for result in comparison["results"]:
        for row in result["times"]:
            own, note = row["auto"], row["note"]
            cells = [bounded("more than", result[key]["light_missing"], row[key]) for key in others]
            cells.append(note if own is None else bounded(note, bool(note), own))
            for key in others:
                least = bool(note or result[key]["light_missing"])
                cells.append("–" if own is None else bounded("at least", least, row[key] / own))
            lines.append(f"| {result['scene']} | {row['relmse']} | " + " | ".join(cells) + " |")
    lines += ["", "| scene | by default takes | Mitsuba's mean over ours | blocks differ by relMSE | of which noise"
              " | mean of `path` over ours | blocks differ by relMSE | of which noise |",
              "|---|---|---:|---:|---:|---:|---:|---:|"]
    for result in comparison["results"]:
        taken = ", ".join(f"`{name}`" for name in dict.fromkeys(result["taken"].values()))
        cells = [f"{a['ratio_of_means']:.4f} | {a['difference']:.1e} | {a['noise']:.1e}"
                 for a in (result[key]["agreement"] for key in others)]
        lines.append(f"| {result['scene']} | {taken} | " + " | ".join(cells) + " |")
    return "\n".join(lines)

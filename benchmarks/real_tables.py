"""The tables of bench_real_registration, as markdown."""

INSIDE_95 = {"perspective": 12.592, "orthographic": 11.070}
"""95 % quantile of chi-square with 6 degrees of freedom, and with 5: an orthographic camera does not tell depth."""


def tables(results: dict) -> str:
    """Return all tables whose rows are there."""
    made = {"right": _right, "wrong": _wrong, "picks": _picks}
    found = [f"{table(results[row])}\n" for row, table in made.items() if row in results]
    return "\n".join([*found, f"(At {results['commit']}.)\n"])


def _right(marks: list) -> str:
    lines = [
        "| photographs, camera, turn | away from the set's pose | sigma stated | in the 95 % region | outline, px: "
        "ours, set's | shading: ours, set's | normals: ours, set's | truth against the set's normals: at our pose, "
        "at the set's | said |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for (name, projection, seed), mark in marks:
        head = f"| {name}, {projection}, {seed} | "
        if "refused" in mark:
            lines.append(f"{head}refused | | | | | | | {_short(mark['refused'])} |")
            continue
        inside = "yes" if mark["inside_square"] < INSIDE_95[projection] else "no"
        # A ball may turn: its centre may not move.
        away = f"{mark['degrees']:.2f}°, {mark['apart_px']:.2f} px (mean {_pair(mark['mean_px'])})"
        cells = [
            f"its centre {mark['center_px']:.2f} px" if name == "ball" else away,
            "" if name == "ball" else f"{mark['sigma_deg']:.2f}°",
            "" if name == "ball" else inside,
            *(
                _pair([mark[side][key] for side in ("ours", "given")], digits)
                for key, digits in (("outline_px", 2), ("shading", 4), ("normals_deg", 2))
            ),
            f"{mark['truth_deg']:.2f}°, {mark['truth_at_given_deg']:.2f}°",
            "; ".join(_short(text) for text in mark["said"]) or "nothing",
        ]
        lines.append(head + " | ".join(cells) + " |")
    return "\n".join(lines)


def _wrong(marks: list) -> str:
    lines = ["| photographs, camera | surface | what came of it |", "|---|---|---|"]
    for (name, projection, fault), mark in marks:
        if "refused" in mark:
            came = f"refused: {_short(mark['refused'])}"
        else:
            came = "warned: " + "; ".join(map(_short, mark["said"])) if mark["said"] else "accepted in silence"
        lines.append(f"| {name}, {projection} | {fault} | {came} |")
    return "\n".join(lines)


def _picks(marks: dict) -> str:
    lines = [
        "| object | its map at the set's pose, off at most | silhouette over label | picks 0.5 px off: pose off by | "
        "picks 2 px off |",
        "|---|---|---|---|---|",
    ]
    for name, mark in marks.items():
        hull = "" if "mug" in name else f"{mark['overlap']:.3f}"
        cells = [f"{mark['reprojection_px']:.3f} px", hull]
        cells += [f"{turn:.2f}°, {shift:.1f} mm, {px:.2f} px" for turn, shift, px in (mark["0.5"], mark["2.0"])]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _pair(values: list, digits: int = 2) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _short(text: str) -> str:
    """Return the first words of a message, up to its first colon after the field's name."""
    return text.removeprefix("scan: ").split(":")[0].split(" (cost")[0].split(" in the photographs all round")[0]

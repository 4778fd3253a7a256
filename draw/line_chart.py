"""A chart of named lines, with their spread."""

from collections.abc import Mapping, Sequence

from draw.svg import COLOURS, Axis, Drawing, Frame, axes, legend, legend_width, line, svg

FRAME = Frame(64, 20, 550, 348)


def line_chart(
    lines: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    *,
    x_title: str,
    y_title: str,
    log_x: bool = False,
    log_y: bool = False,
    spreads: Mapping[str, tuple[Sequence[float], Sequence[float]]] | None = None,
    x_names: Sequence[str] = (),
) -> Drawing:
    """Return the SVG of named lines; the axes span the data.

    Parameters
    ----------
    lines : mapping of str to (x, y)
        What is not a number is left out.
    x_title, y_title : str
    log_x, log_y : bool
    spreads : mapping of str to (low, high), optional
        Of lines, at their x: shaded.
    x_names : sequence of str
        Ticks of x = 0, 1, 2 ... by name, instead of numbers.
    """
    spreads = spreads or {}
    x = Axis.over([x for x, _ in lines.values()], FRAME.left, FRAME.right, log=log_x)
    heights = [*(y for _, y in lines.values()), *(edge for spread in spreads.values() for edge in spread)]
    y = Axis.over(heights, FRAME.bottom, FRAME.top, log=log_y)
    if x_names:
        x.ticks[:] = [(float(place), name) for place, name in enumerate(x_names)]
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(lines)}
    parts = axes(x, y, FRAME, x_title=x_title, y_title=y_title)
    for name, (low, high) in spreads.items():
        at = lines[name][0]
        outline = [*zip(at, high, strict=True), *reversed([*zip(at, low, strict=True)])]
        places = ((x.at(a), y.at(b)) for a, b in outline)
        parts.append(line(places, "none", fill=colours[name], fill_opacity="0.13"))
    for name, pair in lines.items():
        places = ((x.at(a), y.at(b)) for a, b in zip(*pair, strict=True))
        parts.append(line(places, colours[name], stroke_width=2.5))
    beside = FRAME.right + 14
    parts += legend(colours, beside, FRAME.top + 14)
    width = max(720, round(beside + legend_width(colours) + 6))
    return svg(width, 400, parts, label=f"{y_title} against {x_title}")

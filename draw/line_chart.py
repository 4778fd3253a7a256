"""A chart of named lines, with their spread."""

from collections.abc import Mapping, Sequence

from draw.svg import COLOURS, Axes, Axis, Drawing, legend, svg


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
    x = Axis.over([x for x, _ in lines.values()], 64, 550, log=log_x)
    heights = [*(y for _, y in lines.values()), *(edge for spread in spreads.values() for edge in spread)]
    y = Axis.over(heights, 348, 20, log=log_y)
    if x_names:
        x.ticks[:] = [(float(place), name) for place, name in enumerate(x_names)]
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(lines)}
    on = Axes(x, y)
    parts = on.drawn(x_title, y_title)
    for name, (low, high) in spreads.items():
        at = lines[name][0]
        outline = [*zip(at, high, strict=True), *reversed([*zip(at, low, strict=True)])]
        parts.append(on.line(outline, "none", fill=colours[name], fill_opacity="0.13"))
    parts += [on.line(zip(*pair, strict=True), colours[name], stroke_width=2.5) for name, pair in lines.items()]
    named, end = legend(colours, x.end + 14, y.end + 14)
    return svg(max(720, round(end + 6)), 400, [*parts, *named], label=f"{y_title} against {x_title}")
